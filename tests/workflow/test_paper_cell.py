"""The EDBB paper's cell as it is shipped: it holds fixture, tool and zero, which the robot's own errors have put off.

The true robot is walked by the generator's arm, which shares no code with the planner, with the errors that the
simulated run says are true.
"""

import json
import os
import re

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.documents.calibrated_robot import CalibratedRobot
from planner.kinematics.robot_reader import load_robot
from planner.model.tool_error import uniform_states
from tests.blind.workspace import difference
from tests.command import edbb
from tests.simulation.generator.arm import Arm, moment_of_weight

NAME = "comau-nj130/paper"
STATES = 500
TRUTH = re.compile(r"# truth: (\w+?)_(mm|deg|urad_Nm) = (\S+)")
UNITS = {"mm": 1e-3, "deg": np.pi / 180, "urad_Nm": 1e-6}
ALL = bool(os.environ.get("EDBB_ALL_TRIALS"))  # all take three minutes
SEEDS = range(8) if ALL else (0, 2)  # the two that were wrong
FARTHEST = 4.0  # standard deviations of a joint zero: of 32 the farthest is beyond 3.3 once in 30 times


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the plan that the documentation of the cell makes."""
    out = tmp_path_factory.mktemp("paper")
    assert edbb("plan", NAME, "--poses", "35", "-o", out / "plan").returncode == 0
    return out


def true_errors(run):
    """Errors behind a simulated run by their names [m, rad, rad/Nm]."""
    lines = [line for line in run.read_text().splitlines() if line.startswith("#")]
    return {m[1]: float(m[3]) * UNITS[m[2]] for line in lines if (m := TRUTH.match(line))}


def true_tool(errors, cell, q):
    """Where the tool of the robot with these errors is at angles q (n, N) [rad], its joints giving way, (n, 3) [m]."""
    arm = Arm.from_toml("comau-nj130")
    own = {n: v for n, v in errors.items() if n in arm.names}
    joints = [f"theta{j + 1}" for j in range(q.shape[1])]
    nominal = arm.walk(q, {}, keep=joints)  # loads are those of the arm as it is drawn
    com = nominal.p + np.einsum("ijn,j->in", nominal.R, cell.tool.com_F)
    for j, name in enumerate(joints):
        moment = moment_of_weight(arm, nominal, name, arm.mass, [(cell.tool.mass, com)])
        own[name] = own.get(name, 0.0) + errors.get(f"compliance{j + 1}", 0.0) * moment
    there = arm.walk(q, own)
    tool = cell.tool.p_FM + [errors.get(f"map_{a}", 0.0) for a in "xyz"]
    return (there.p + np.einsum("ijn,j->in", there.R, tool)).T


def judge(folder, seed):
    """Simulate and identify; return stated and true error over the workspace [m], zeros with σ and truth, findings."""
    plan, run, out = folder / "plan", folder / f"run{seed}.csv", folder / f"out{seed}"
    assert edbb("simulate", plan / "plan.json", "--seed", seed, "-o", run).returncode == 0
    done = edbb("identify", run, "--cell", plan / "cell.toml", "--plan", plan / "plan.json", "-o", out)
    assert done.returncode == 0, done.stderr
    found, cell, errors = json.loads((out / "identification.json").read_text()), load_cell(NAME), true_errors(run)
    q = uniform_states(cell, STATES, 1)
    p, R = CalibratedRobot(load_robot(out / "robot.toml")).flange(q)
    fitted = {e["name"]: e for e in found["parameters"]}
    tool = np.array([fitted[f"map_{a}"]["value"] for a in "xyz"]) * 1e-3
    off = difference(p + R @ tool, true_tool(errors, cell, q))
    zeros = {
        e["name"]: (np.radians(e["value"] - e["nominal"]), np.radians(e["std"]), errors[e["name"]])
        for e in found["parameters"]
        if re.fullmatch(r"theta\d", e["name"]) and e["identifiable"]
    }
    return found, float(np.sqrt((off**2).sum(axis=1).mean())), zeros


@pytest.fixture(scope="module")
def judged(folder):
    """What came of every seed, in order."""
    return [judge(folder, seed) for seed in SEEDS]


@pytest.mark.long
def test_the_paper_cell_as_shipped_tells_the_truth(judged):
    """It named a gauge scale of 606 ppm, stated 0.6 mm where the truth was 2.3, and zeros had the wrong sign."""
    ratio = []
    for seed, (found, true, zeros) in zip(SEEDS, judged, strict=True):
        ratio.append(found["known_anywhere_mm"] * 1e-3 / true)
        assert true < 0.2e-3, seed
        assert "fixture place" in {f["effect"] for f in found["findings"]}, seed
        assert not any(f["effect"].startswith("gauge") for f in found["findings"]), seed
        assert set(zeros) == {"theta2", "theta3", "theta4", "theta5"}, seed
        for name, (value, std, truth) in zeros.items():
            assert abs(value - truth) < FARTHEST * std, (seed, name)
    assert not ALL or 0.8 < np.median(ratio) < 1.25, ratio
    assert all(0.3 < one < 4.0 for one in ratio), ratio
