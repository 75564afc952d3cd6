"""Minutes to a stated bound, in batches until it is reached and by plans of fixed size.

``python -m tests.benchmarks.stopping LOG.jsonl``.
Arms are those of ``tests.independent_arms``, which share nothing with the planner's code: 0 to 3 hidden causes of the
catalogue, every other arm with one that no catalogue has. All choose among the same poses in the bar's shell:

- ``sequential``: 40 poses as a plan of nothing known chooses them, then 15 at a time by what the run so far leaves, the
  gauge left standing;
- ``batches``: the same, each batch with the bar set up anew, all identified as one;
- ``plan``: the same rule as for the first 40, for a number of poses that is fixed beforehand;
- ``d-optimal``: the largest determinant of the information on the geometry, taken greedily;
- ``next-view``: a pose at a time by the trace of the geometry's covariance, after arXiv 2303.06766.

A bound is what ``edbb identify`` states (``at_most_mm``); a pose takes 21 s, a batch 3 min more. Of plans of fixed size
the bound is asked after 40, 55, 70 … poses, as if it had been known beforehand which size is enough. True errors are
those of the tool that ``edbb compensate`` corrects. One line of LOG an arm and a way; what is there is not done again.
"""

import argparse
import json
import shutil
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

from planner.cell.reading import load_cell
from planner.design.bayesian_design import BayesianPosterior, select_greedily
from planner.design.free_parameters import undeclared_errors
from planner.instruments.next_session import CalibratedState, RemainingErrors
from planner.runs.run import Samples
from planner.workflow.identification import identify
from tests.independent_arms import runs
from tests.independent_arms.arm import make_arm
from tests.independent_arms.judge import evaluation_states, model_error
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.poses import at_targets, shell_points

FIRST, STEP, MOST = 40, 15, 130  # poses
SECONDS_A_POSE, MINUTES_A_BATCH = 21.0, 3.0
GOALS_MM = (0.4, 0.2, 0.1)
WAYS = ("sequential", "batches", "plan", "d-optimal", "next-view")
SHARE_OF_PLACE = 1e-2  # of what is unknown of the gauge's place, in greedy choices: else it comes first


@cache
def pool():
    """Poses (n, 6) [rad] in the bar's shell from which all ways choose, and the cell."""
    cell = load_cell(str(runs.CELLS["bar"]), planning=False)
    rng = np.random.default_rng(1)
    arm, tool = Arm.from_toml("comau-nj130"), np.array([0.050, 0.0, 0.150])
    aim = shell_points(runs.FIXTURE, np.array([0.308, 0.512]), 500, rng, 1.3)
    q = at_targets(arm, aim, tool, rng)
    return q[~np.isnan(q[:, 0])], cell


def samples(q):
    return Samples(q, np.zeros(len(q), dtype=int))


def greedy(unknown, rows, count):
    """Positions of ``count`` poses by the error that they leave."""
    start = np.where(unknown.of_gauge, SHARE_OF_PLACE, 1.0)
    known = BayesianPosterior.prior(rows * start, unknown.weight_per_prior)
    return select_greedily(known, count, 0.0)


@cache
def fixed_order(way):
    """Positions in the pool in the order in which a way that knows nothing of the robot takes them."""
    q, cell = pool()
    unknown = undeclared_errors(cell, samples(q))
    white = unknown.white(samples(q))
    if way in ("sequential", "batches", "plan"):
        return greedy(unknown, white, MOST)
    of_geometry = np.array([not p.is_effect for p in unknown.model.parameters])
    rows, order = white[:, of_geometry], []
    covariance = np.eye(rows.shape[1])
    for _ in range(MOST):
        seen = rows @ covariance
        spread = 1.0 + np.einsum("ij,ij->i", seen, rows)
        gain = np.log(spread) if way == "d-optimal" else (seen**2).sum(axis=1) / spread
        gain[order] = -np.inf
        k = int(np.argmax(gain))
        covariance = covariance - np.outer(seen[k], seen[k]) / spread[k]
        order.append(k)
    return np.array(order)


def measure(true, q, folder, batch=0):
    """Measure poses into the folder of a session, its noise and set-up drawn anew."""
    folder.mkdir(parents=True)
    other = true.__class__(**{**vars(true), "seed": true.seed + 10_000 * batch})
    columns = runs.bar_at_rest(other, q)
    runs.write_run(columns, folder / "run.csv")
    shutil.copy(runs.CELLS["bar"], folder / "cell.toml")
    return columns


def calibrate(paths, folder):
    """Identify the runs and write what the next step needs; the bound in mm."""
    found = identify([str(p / "run.csv") for p in paths] if len(paths) > 1 else paths[0] / "run.csv",
                     cell=None if len(paths) > 1 else paths[0] / "cell.toml", no_trace=True)  # fmt: skip
    folder.mkdir()
    (folder / "identification.json").write_text(found.to_json())
    found.write_robot(folder)
    return 1e3 * found.calibration.release.at_most, 1e3 * found.calibration.workspace_error


def judge_way(seed, way, folder):
    """Rows of one arm and one way: after each number of poses the minutes, the bound, and stated and true error."""
    q, cell = pool()
    true = make_arm(seed, "bar", seed % 4, bool(seed % 2))
    at, rows, taken, sessions = evaluation_states(true.arm, seed), [], list(fixed_order(way)[:FIRST]), []
    new = taken
    while True:
        number = len(rows)
        if way == "batches":
            sessions.append(folder / f"batch{number}")
            columns = measure(true, q[new], sessions[-1], number)
        else:
            sessions = [folder / f"plan{number}"]
            columns = measure(true, q[taken], sessions[0])
        known = folder / f"known{number}"
        bound, stated = calibrate(sessions, known)
        minutes = len(taken) * SECONDS_A_POSE / 60 + MINUTES_A_BATCH * (len(sessions) - 1)
        off = model_error(true, at, known / "robot.toml", folder, runs.middle(columns["t_s"]))[0]
        rows.append({"poses": len(taken), "minutes": minutes, "bound": bound, "stated": stated, "true": off})
        if bound <= min(GOALS_MM) or len(taken) + STEP > MOST:
            return rows
        if way in ("sequential", "batches"):
            unknown = RemainingErrors.of(CalibratedState.read(known, cell), cell, samples(q))
            free = np.setdiff1d(np.arange(len(q)), taken)
            new = list(free[greedy(unknown, unknown.white(samples(q[free])), STEP)])
            taken = [*taken, *new]
        else:
            taken = list(fixed_order(way)[: len(taken) + STEP])


def first_below(rows, goal):
    """The first row whose bound is below a goal; ``None`` where none is."""
    return next((r for r in rows if r["bound"] <= goal), None)


def table(lines):
    """Minutes to each goal by way: median and 90 % over arms, how many reach it, how true what is stated is."""
    out = [
        "| bound | way | arms that reach it | minutes, median | minutes, 90 % | stated over true | true below |",
        "|---|---|---|---|---|---|---|",
    ]
    for goal in GOALS_MM:
        for way in WAYS:
            own = [line["rows"] for line in lines if line["way"] == way]
            hit = [r for rows in own if (r := first_below(rows, goal))]
            if not own:
                continue
            minutes = np.sort([*(r["minutes"] for r in hit), *[np.inf] * (len(own) - len(hit))])
            middle, most = (minutes[int(np.ceil(share * len(minutes))) - 1] for share in (0.5, 0.9))
            ratio = f"{np.median([r['stated'] / r['true'] for r in hit]):.2f}" if hit else "–"
            below = f"{sum(r['true'] <= r['bound'] for r in hit)} of {len(hit)}"
            said = [f"{m:.0f}" if np.isfinite(m) else "not reached" for m in (middle, most)]
            out.append(f"| {goal} mm | {way} | {len(hit)} of {len(own)} | {said[0]} | {said[1]} | {ratio} | {below} |")
    return "\n".join(out)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("log", type=Path)
    parser.add_argument("--arms", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--ways", nargs="+", default=WAYS, choices=WAYS)
    parser.add_argument("--table", action="store_true", help="only print the table of what stands in the log")
    given = parser.parse_args()
    text = given.log.read_text() if given.log.exists() else ""
    lines = [json.loads(line) for line in text.splitlines()]
    for seed in range(given.first_seed, given.first_seed + (0 if given.table else given.arms)):
        for way in given.ways:
            if any((line["seed"], line["way"]) == (seed, way) for line in lines):
                continue
            with tempfile.TemporaryDirectory() as folder:
                lines.append({"seed": seed, "way": way, "rows": judge_way(seed, way, Path(folder))})
            with given.log.open("a") as log:
                log.write(json.dumps(lines[-1]) + "\n")
    print(table(lines))


if __name__ == "__main__":
    main()
