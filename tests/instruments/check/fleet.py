"""Robots that are calibrated, measured again and have changed or not: readings by the generator's own forward model."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from planner.cell.cell import Cell
from planner.identification.baseline import Baseline, BaselineFile
from planner.identification.identifiable_parameters import identifiable_subset
from planner.identification.problem import FitProblem
from planner.instruments.check.changes import possible_changes
from planner.instruments.check.planning import choose_check_poses
from planner.model.model import Model
from planner.runs.run import Readings, Run, Samples
from tests.identification.worlds import World, world
from tests.simulation.generator.truth import Noise, draw_errors

CALIBRATED, POSES, FREEDOM = 60, 10, 40.0
NAME = "kuka-kr6-r700"


@dataclass(frozen=True, eq=False)
class Fleet:
    """One cell, its calibrations of ``CALIBRATED`` poses, and the poses (10, N) [rad] of the check."""

    world: World
    check: World
    model: Model
    root: np.ndarray
    noise: Noise
    cell: Cell

    def baseline(self, errors, rng) -> Baseline:
        """What a calibration of the arm with these errors finds: off by a draw from its own covariance."""
        size = float(np.sqrt(rng.chisquare(FREEDOM) / FREEDOM))
        values = self.world.regrouped(errors)[0] + self.root @ rng.standard_normal(self.root.shape[1])
        setup = self.model.setup
        file = BaselineFile(
            schema="edbb-posterior/1", robot=NAME, robot_sha256="", gauge=self.cell.gauge.kind,
            fixtures=dict(zip(setup.place_names, setup.p_BX.tolist(), strict=True)),
            points=dict(zip(setup.point_names, setup.p_FM.tolist(), strict=True)), noise=(size, size), freedom=FREEDOM,
            rest=0.0, parameters=[{"name": n, "value": v} for n, v in zip(self.model.names, values, strict=True)],
            spread=(self.root * size).tolist(),
        )  # fmt: skip
        return Baseline.of(file, self.cell, "baseline")

    def read(self, errors, rng, moved=None) -> Run:
        """The run of a check; the zero of the bar is another one."""
        errors = dict(errors) | {"zero": float(rng.normal(0.0, 3e-4))}
        n, joints = self.check.q.shape
        off = self.noise.joint * rng.standard_normal((n, joints))
        angles = {f"theta{i + 1}": off[:, i] + (moved or {}).get(i, 0.0) for i in range(joints)}
        length = self.check.read(errors, angles) + self.noise.gauge * rng.standard_normal(n)
        samples = Samples(self.check.q, np.zeros(n, dtype=int))
        return Run("check", samples, Readings(length=length), self.world.run.places, robot=NAME)


@cache
def fleet() -> Fleet:
    """The cell of the generator, calibrated in 60 poses, with a check of ten others."""
    w = world(NAME, 150, seed=4)
    calibrated = np.arange(CALIBRATED)
    part = replace(w.run, samples=w.run.samples.take(calibrated), readings=w.run.readings.take(calibrated))
    model = identifiable_subset(w.model, part.samples)[0]
    mine = replace(w, q=w.q[calibrated], t=w.t[calibrated], run=part, model=model)
    problem = FitProblem.of(model, part)
    rows = problem.piece(slice(0, CALIBRATED), np.zeros(len(model.names))).rows[:, 0]
    information = rows.T @ rows + np.eye(len(model.names))
    root = model.prior[:, None] * np.linalg.inv(np.linalg.cholesky(information)).T
    noise = Noise(model.setup.gauge.noise, model.joint_sigma)
    whole = Fleet(mine, mine, model, root, noise, w.cell)
    known = whole.baseline(draw_errors(w.arm, np.random.default_rng(0)), np.random.default_rng(0))
    pool = Samples(w.q[CALIBRATED:], np.zeros(len(w.q) - CALIBRATED, dtype=int))
    changes = possible_changes(w.cell, known.model.setup, with_play=False)
    q = pool.q[choose_check_poses(known, changes, pool, POSES)]
    return replace(whole, check=replace(mine, q=q, t=np.arange(POSES) * 20.0))
