"""A tool with two measured points: each is a measured tool, and its error is stated as such, against pinocchio."""

import numpy as np
import pytest

from planner.documents.expected_error import ExpectedError
from planner.kinematics.robot_reader import load_robot
from tests.command import edbb
from tests.compensation.robots import bent, exact, flange_pose
from tests.identification.few_draws import few_draws

POINTS_MM = {"1": (20.0, 0.0, 100.0), "2": (-60.0, 40.0, 130.0)}
OTHER_MM = (20.0, 80.0, 100.0)  # a tool that nobody measured
CELL = """
schema = "edbb-cell/1"
robot = "ur5e"
home_deg = [0, -90, 0, -90, 0, 0]

[tool]
mass_kg = 1
com_mm = [0, 0, 50]
map_mm = [20, 0, 100]

[[tool.points]]
name = "2"
map_mm = [-60, 40, 130]

[gauge]
kind = "tracker"
noise_um = 10

[tracker]
position_mm = [2500, 0, 400]
rpy_deg = [0, 0, 180]

[plan]
free = ["tool"]
"""
NAMES = ["pose", *(f"q{k}_deg" for k in range(1, 7)), "x_mm", "y_mm", "z_mm", "point"]


def read(folder):
    """The calibrated robot, and what is known of its errors."""
    robot = load_robot(str(folder))
    known = ExpectedError.read(robot, folder / "robot.toml")
    assert isinstance(known, ExpectedError), known
    return robot, known


def place(T, p_mm):
    """Where a point of the tool is in the base frame [mm]."""
    return 1e3 * T[:3, 3] + T[:3, :3] @ np.array(p_mm)


def rms_after_alignment(x, y):
    """Distance of points x from y (n, 3) after x was turned and shifted onto y (Kabsch), rms."""
    a, b = x - x.mean(axis=0), y - y.mean(axis=0)
    U, _, Vt = np.linalg.svd(a.T @ b)
    R = U @ np.diag([1, 1, np.sign(np.linalg.det(U @ Vt))]) @ Vt
    return float(np.sqrt(((a @ R - b) ** 2).sum(axis=1).mean()))


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """The folder of a robot whose two tool points a tracker has read at 60 poses, and the true arm."""
    folder, rng = tmp_path_factory.mktemp("points"), np.random.default_rng(3)
    _, truth = bent("ur5e", seed=3, size=3e-4, give=0.0)
    shift_mm = {name: rng.normal(0.0, 0.3, 3) for name in POINTS_MM}  # off what the cell says
    lines = [",".join(NAMES)]
    for k, q in enumerate(rng.uniform(-2.5, 2.5, (60, 6))):
        name = "12"[k % 2]
        x = place(flange_pose(truth, q), POINTS_MM[name] + shift_mm[name]) * [-1, -1, 1] + [2500, 0, -400]
        x = x + rng.normal(0.0, 0.01, 3)
        lines.append(",".join([str(k + 1), *(f"{v:.6f}" for v in (*np.degrees(q), *x)), name]))
    (folder / "run.csv").write_text("\n".join(lines) + "\n")
    (folder / "cell.toml").write_text(CELL)
    with few_draws():
        done = edbb("identify", folder / "run.csv", "--cell", folder / "cell.toml", "--geometry", "-o", folder / "out")
    assert done.returncode == 0, done.stderr
    return folder / "out", truth, shift_mm


@pytest.mark.slow
def test_each_measured_point_is_a_measured_tool(calibrated, tmp_path):
    folder, *_ = calibrated
    robot, known = read(folder)
    points = {t.name: t.p_FM for t in robot.tool_points}
    q = np.random.default_rng(5).uniform(-2.5, 2.5, (400, 6))
    rms = {name: float(np.sqrt((known.at(q, p).released ** 2).mean())) * 1e3 for name, p in points.items()}
    other = float(np.sqrt((known.at(q, np.array(OTHER_MM) / 1e3).released ** 2).mean())) * 1e3
    assert all(known.is_measured(p) for p in points.values())
    assert not known.is_measured(np.array(OTHER_MM) / 1e3)
    # the mount of both points went into the fit alike: neither is known as badly as a tool that nobody measured
    assert rms["2"] == pytest.approx(rms["1"], rel=0.3)
    assert rms["2"] < 0.5 * other

    table = tmp_path / "targets.csv"
    np.savetxt(table, np.degrees(q[:5]), "%.4f", ",", header=",".join(f"q{k}_deg" for k in range(1, 7)), comments="")
    tool = ",".join(f"{v:.4f}" for v in (*(points["2"] * 1e3), 0, 0, 0))
    done = edbb("compensate", table, "--model", folder, "--tool", tool, "-o", tmp_path / "out.csv")
    assert done.returncode == 0, done.stderr
    assert "another tool" not in done.stdout + done.screen


@pytest.mark.slow
def test_what_is_stated_of_both_points_is_as_large_as_the_truth(calibrated):
    folder, truth, shift_mm = calibrated
    written, known = read(folder)
    q = np.random.default_rng(7).uniform(-2.5, 2.5, (300, 6))
    for point in written.tool_points:
        true = [place(flange_pose(truth, v), POINTS_MM[point.name] + shift_mm[point.name]) for v in q]
        found = [place(flange_pose(exact(written), v), point.p_FM * 1e3) for v in q]
        off = rms_after_alignment(np.array(found), np.array(true))
        stated = float(np.sqrt((known.at(q, point.p_FM).released ** 2).mean())) * 1e3
        assert 0.5 < stated / off < 3.0, (point.name, stated, off)
