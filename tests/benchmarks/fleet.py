"""How many poses the k-th robot of a fleet needs. ``python -m tests.benchmarks.fleet [--fleets N] [--goal MM …]``.

A fleet is drawn by its sizes: one for the lengths and one for the angles of each joint, its gear and its compliance,
each log-normal about a half of what is usual with a spread of a factor of 1.4 (a maker whose robots are better than the
catalogue expects, joint by joint not alike). Each of the first k − 1 robots was measured at 80 poses; ``edbb fleet``
learns from their estimates. The k-th is then planned for with ``--until-mm``, and measured: its readings are linear in
its errors, its estimate is the posterior with that prior, its true error is that of the tool over the workspace. Beside
the poses stands how often the true error was below the goal, which should be in 95 of 100 robots. The arm is a KUKA
KR 6 R700 with a bar at one fixture.
"""

import argparse
from bisect import bisect_left
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from planner.cell.fleet_file import FleetFile
from planner.cell.reading import load_cell
from planner.design.bayesian_design import BayesianPosterior, select_greedily
from planner.design.expected_errors import error_limit
from planner.design.free_parameters import undeclared_errors
from planner.effects.effect import geometry_group
from planner.identification.fleet_fit import RobotErrors
from planner.workflow.fleet import Fleet
from tests.benchmarks.stopping import SHARE_OF_PLACE, samples
from tests.identification.joint_world import BAR_LEFT, World

NUMBERS = (1, 2, 3, 5, 10, 20, 50)
MEASURED, MOST = 80, 220  # poses of the robots before, and of the next one at most
BETTER, SPREAD = 0.5, 0.35  # of the usual size, and one sigma of its logarithm
GEAR_KINDS = ("gear once a turn", "gear twice a turn", "gear harmonics", "gear ripple")


@cache
def pool():
    """Poses (n, 6) [rad] in the bar's shell, and the cell."""
    with TemporaryDirectory() as folder:
        made = World.drawn(0).measure(Path(folder), replace(BAR_LEFT, poses=500), 0)
        return made.q, load_cell(str(made.cell), planning=False)


def groups_of(unknown, robot):
    """The group of each error by which a fleet's size is drawn; empty for where the gauge stands."""
    place = {t.name: geometry_group(robot, k) for k, t in enumerate(robot.transforms)}
    out = []
    for p in unknown.model.parameters:
        if p.name.startswith("compliance"):
            out.append(f"compliance, joint {p.name.removeprefix('compliance')}")
        elif p.is_effect:
            joint = next(k for k in range(robot.n_joints) if f"joint {k + 1}" in p.group)
            out.append(f"gear, joint {joint + 1}")
        else:
            out.append(place.get(p.name, ""))
    return out


class Line:
    """One fleet that is drawn: its sizes, its robots, and what each was estimated to have."""

    def __init__(self, seed):
        self.q, self.cell = pool()
        self.usual = undeclared_errors(self.cell, samples(self.q))
        self.groups = groups_of(self.usual, self.cell.robot)
        names = [g for g in dict.fromkeys(self.groups) if g]
        rng = np.random.default_rng([seed, 17])
        self.sizes = dict(zip(names, BETTER * np.exp(SPREAD * rng.standard_normal(len(names))), strict=True))
        self.scale = np.array([self.sizes.get(g, 1.0) for g in self.groups])
        self.rng = rng
        white = self.usual.white(samples(self.q))
        self.std = np.sqrt(np.diag(np.linalg.inv(np.eye(white.shape[1]) + white[:MEASURED].T @ white[:MEASURED])))
        self.robots = [self._robot(k) for k in range(max(NUMBERS) - 1)]

    def _robot(self, number):
        """What is estimated of a robot of the fleet, over the usual sizes, as ``edbb identify`` would show it."""
        truth = self.scale * self.rng.standard_normal(len(self.scale))
        found = []
        for k, group in enumerate(self.groups):
            if group.startswith(("lengths", "angles")) and self.std[k] ** 2 < 0.9:
                alone = 1.0 / np.sqrt(1.0 / self.std[k] ** 2 - 1.0)
                found.append((group, truth[k] + alone * self.rng.standard_normal(), alone))
        for group in self.sizes:
            own = [k for k, g in enumerate(self.groups) if g == group]
            size = float(np.sqrt(np.mean(truth[own] ** 2))) * np.exp(0.2 * self.rng.standard_normal())
            if group.startswith("gear"):
                found += [(f"{kind}, {group.partition(', ')[2]}", size, 0.2) for kind in GEAR_KINDS]
            elif group.startswith("compliance"):
                found.append((group, size, 0.2))
        names, value, std = zip(*found, strict=True)
        return RobotErrors(f"r{number}", names, np.array(value), np.array(std))

    def prior(self, before):
        """The cell as it is planned for after so many robots."""
        if before < 2:
            return self.cell
        file: FleetFile = Fleet.of(self.cell.robot.name, self.robots[:before]).file()
        factors = tuple((s.group, s.factor) for s in file.sizes)
        robot = replace(self.cell.robot, priors=replace(self.cell.robot.priors, factors=factors))
        return replace(self.cell, robot=robot)

    def needed(self, before, goals):
        """For each goal [m]: poses that the plan takes for the next robot, and whether its true error is below."""
        unknown = undeclared_errors(self.prior(before), samples(self.q))
        white = unknown.white(samples(self.q))
        start = np.where(unknown.of_gauge, SHARE_OF_PLACE, 1.0)
        order = select_greedily(BayesianPosterior.prior(white * start, unknown.weight_per_prior), MOST, 0.0)
        truth = self.scale * self.usual.prior / unknown.prior * self.rng.standard_normal(len(self.scale))
        out = []
        for goal in goals:
            count = bisect_left(range(MOST), True, 12, key=lambda n: error_limit(unknown, white[order[:n]]) <= goal)
            if count >= MOST:
                out.append((np.inf, True))
                continue
            rows = white[order[:count]]
            read = rows @ truth + self.rng.standard_normal(len(rows))
            mean = np.linalg.solve(np.eye(rows.shape[1]) + rows.T @ rows, rows.T @ read)
            off = truth - mean
            out.append((count, float(np.sqrt(off @ unknown.weight_per_prior @ off)) <= goal))
        return out


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fleets", type=int, default=10)
    parser.add_argument("--goal", type=float, nargs="+", default=[0.2, 0.1], help="mm")
    given = parser.parse_args()
    lines = [Line(seed) for seed in range(given.fleets)]
    head = " | ".join(f"{g:g} mm: poses, median (90 %) | true error below" for g in given.goal)
    print(f"| k | {head} |\n|---|{'---|' * (2 * len(given.goal))}")
    for k in NUMBERS:
        found = [line.needed(k - 1, [1e-3 * g for g in given.goal]) for line in lines]
        cells = []
        for g in range(len(given.goal)):
            poses = np.sort([f[g][0] for f in found])
            middle, most = (poses[int(np.ceil(share * len(poses))) - 1] for share in (0.5, 0.9))
            said = [f"{p:.0f}" if np.isfinite(p) else f"more than {MOST}" for p in (middle, most)]
            hit = [f[g][1] for f in found if np.isfinite(f[g][0])]
            cells.append(f"{said[0]} ({said[1]}) | {sum(hit)} of {len(hit)}")
        print(f"| {k} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
