"""What the tests of whole chains share: plan, simulated run, evaluation with its report, compensation, check.

A smaller session has fewer poses, measured at rest; circles are few enough to be driven as they are shipped. The plan
of a cell is made once for all seeds of the robot.
"""

import json
import os
import re
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import tomli_w

from planner.cell.reading import load_cell
from planner.kinematics.inverse_kinematics import smallest_singular_value
from tests.command import edbb
from tests.shipped import cells_that

ROBOTS = Path(__file__).resolve().parents[2] / "robots"
CELLS = tuple(f"{path.parents[1].name}/{path.stem}" for path in sorted(ROBOTS.glob("*/cells/*.toml")))
GOOD = (0, 5)  # exit codes: done, and done in part
MOST_OUTSIDE = 0.01  # share of the readings that the gauge could not have made
SMALL = {  # keys of a smaller session
    "plan": {"poses": 48, "repeat": 2, "validate": 4, "candidates": 3000, "refine": False},
    "motion": {"measure": "static"},
}
VALIDATES = ("kuka-kr6-r700/tracker",)  # random poses that judge a robot, none that calibrate it
IN_CIRCLES = tuple(cells_that(lambda cell: cell.sections))
LARGE = {"comau-nj130/paper": ("--poses", "35")}  # as its documentation plans it
ON_DEMAND = pytest.mark.skipif(
    not os.environ.get("EDBB_ALL_TRIALS"), reason="takes half an hour with the others: only with EDBB_ALL_TRIALS=1"
)
SEEDS = (1, 2, *(pytest.param(seed, marks=ON_DEMAND) for seed in (0, 3, 4)))


@cache
def planned(folder, name, small):
    """The folder of a cell's plan, made once for all seeds of the robot."""
    out, cell, more = folder / f"{name.replace('/', '-')}{'-small' * small}", name, LARGE.get(name, ())
    if small and name not in IN_CIRCLES:
        file = tomllib.loads(load_cell(name).path.read_text())
        sections = {key: file.get(key, {}) | own for key, own in SMALL.items()}
        if name in VALIDATES:
            del sections["plan"]["poses"]
            sections["plan"]["validate"] = 40
        cell, more = folder / f"{out.name}.toml", ()
        cell.write_text(tomli_w.dumps(file | {key: own for key, own in sections.items()}))
    succeed("plan", cell, "-o", out, "--seed", int(small), *more)
    return out


def succeed(*words):
    """Run a command that must end well; return all that it said."""
    done = edbb(*words)
    assert done.returncode in GOOD, f"edbb {' '.join(map(str, words))}: {done.returncode}\n{done.stderr}"
    assert "Traceback" not in done.screen
    return done.stdout + done.screen


def check_readings(plan, run, said):
    """Count the readings that the gauge could not have made: from the file itself, and as the command says."""
    low, high = json_range(plan)
    table = pl.read_csv(run, comment_prefix="#")
    assert len(table) > 10
    if "length_mm" in table.columns:
        length = table["length_mm"].to_numpy()
        assert ((length < low) | (length > high)).mean() <= MOST_OUTSIDE
    for some, of in re.findall(r"note: (\d+) of (\d+) ", said):
        assert int(some) <= MOST_OUTSIDE * int(of), said


def json_range(plan):
    """Shortest and longest length [mm] as the plan's own cell says them."""
    return tomllib.loads((plan / "cell.toml").read_text())["gauge"].get("length_mm") or (-np.inf, np.inf)


def evaluate(folder, name, plan, run, seed):
    """Evaluate a run by what fits its cell; with a calibrated robot correct two targets, and check it."""
    out, belongs = folder / f"{run.stem}-out", ("--cell", plan / "cell.toml", "--plan", plan / "plan.json")
    if name in IN_CIRCLES:
        loaded = any(s.pulls for s in load_cell(name).sections.values())
        said = (
            succeed("loaded", run, *belongs, "-o", out) if loaded else succeed("circular", run, *belongs[2:], "-o", out)
        )
    elif name in VALIDATES:
        said = succeed("accuracy", run, *belongs, "-o", out)
    else:
        said = succeed("identify", run, *belongs, "-o", out)
        assert "WORSE THAN THE NOMINAL ROBOT" not in said
        cell = load_cell(str(plan / "cell.toml"))
        if cell.robot.n_joints > 5:  # an arm of five joints cannot correct place and orientation
            compensate_two_targets(plan, cell, out)
    assert (out / "report.html").stat().st_size > 10_000


def compensate_two_targets(plan, cell, calibrated):
    """Correct two poses of the plan as joint targets: they move, and by no more than a robot errs."""
    poses = json.loads((plan / "plan.json").read_text())["poses"]
    q = np.deg2rad([p["q_deg"] for p in poses if p["role"] == "calibrate"])
    robot = cell.robot
    room = np.minimum(q - robot.q_lower, robot.q_upper - q).min(axis=1)
    roomy = q[np.argsort(-room)[:10]]  # far from the limits; of these the farthest from a singular position
    bent = smallest_singular_value(cell.chain, robot, roomy)
    q = np.rad2deg(roomy[np.argsort(-bent)[:2]])
    header = ",".join(f"q{j + 1}_deg" for j in range(q.shape[1]))
    targets = calibrated.parent / f"{calibrated.name}-targets.csv"
    targets.write_text("\n".join([header, *(",".join(f"{v:.6f}" for v in row) for row in q)]) + "\n")
    corrected = calibrated.parent / f"{calibrated.name}-corrected.csv"
    succeed("compensate", targets, "--model", calibrated / "robot.toml", "-o", corrected)
    moved = pl.read_csv(corrected, comment_prefix="#").select(pl.col("^q.*_deg$")).to_numpy() - q
    assert 0.0 < np.abs(moved).max() < 10.0


def run_chain(folder, name, seed, small):
    plan = planned(folder, name, small)
    run = folder / f"{plan.name}-{seed}.csv"
    check_readings(plan, run, succeed("simulate", plan / "plan.json", "-o", run, "--seed", seed))
    evaluate(folder, name, plan, run, seed)
    return plan
