"""A probe's angles: the convention stands in the columns, is tried against the joint angles, and is said."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError
from planner.kinematics.robot_reader import load_robot
from planner.runs.loader import load_run
from planner.runs.probe_turns import settle_turns
from planner.runs.writer import save_run

WRITE = {
    "moving": lambda R: R.as_euler("XYZ"),
    "fixed": lambda R: R.as_euler("xyz"),
    "vector": lambda R: R.as_rotvec(),
}


@pytest.fixture(scope="module")
def robot():
    return load_robot("ur5e")


def truth(robot, spread: float, n: int = 30):
    """Return angles of the joints (n, 6), and how a probe somewhere on the flange is seen from a station anywhere."""
    rng = np.random.default_rng(7)
    q = np.array([0.3, -1.2, 1.4, -0.5, 0.9, 0.2]) + rng.uniform(-spread, spread, (n, 6))
    R_BF = Rotation.from_matrix(np.moveaxis(robot.chain.forward(robot.theta(q)).R, 2, 0))
    R_GB, R_FM = R_BF[0].inv() * Rotation.from_rotvec([0.1, 0.05, -0.1]), Rotation.from_rotvec([0.02, 0.3, 0.05])
    noise = Rotation.from_rotvec(rng.normal(0, 3e-4, (n, 3)))
    return q, R_GB * R_BF * R_FM * noise


def write(path, q, turns, titles):
    columns = [*np.rad2deg(q).T, *np.full((3, len(q)), 500.0), *turns.T]
    head = [*(f"q{k}_deg" for k in range(1, 7)), "x_mm", "y_mm", "z_mm", *titles]
    path.write_text("\n".join([",".join(head), *(",".join(map(repr, map(float, row))) for row in np.array(columns).T)]))
    return load_run(path, 6)


def off(run, R) -> float:
    return float(np.rad2deg(np.abs((R.inv() * Rotation.from_matrix(run.readings.rotation)).magnitude()).max()))


@pytest.mark.parametrize("convention", WRITE)
@pytest.mark.parametrize("said", [True, False])
@pytest.mark.parametrize("spread", [0.3, 1.5])
def test_the_convention_is_read_where_it_is_said_and_found_where_it_is_not(tmp_path, robot, convention, said, spread):
    q, R = truth(robot, spread)
    titles = [f"r{axis}_{f'{convention}_' if said else ''}deg" for axis in "xyz"]
    run = settle_turns(write(tmp_path / "run.csv", q, np.rad2deg(WRITE[convention](R)), titles), robot)
    assert off(run, R) < 1e-6
    noted = [w for w in run.warnings if "turn the probe" in w]
    assert len(noted) == (not said and convention != "moving")
    save_run(run, tmp_path / "again.csv")
    assert off(settle_turns(load_run(tmp_path / "again.csv", 6), robot), R) < 1e-5


def test_angles_whose_convention_is_open_are_written_as_they_are(tmp_path, robot):
    q, R = truth(robot, 1.5)
    turns = np.rad2deg(WRITE["vector"](R))
    run = write(tmp_path / "run.csv", q, turns, ["rx_deg", "ry_deg", "rz_deg"])
    save_run(run, tmp_path / "again.csv")
    assert off(settle_turns(load_run(tmp_path / "again.csv", 6), robot), R) < 1e-5


@pytest.mark.parametrize(("written", "said"), [("fixed", "moving"), ("moving", "fixed"), ("vector", "fixed")])
def test_a_convention_that_the_joint_angles_contradict_is_refused(tmp_path, robot, written, said):
    q, R = truth(robot, 1.0)
    titles = [f"r{axis}_{said}_deg" for axis in "xyz"]
    run = write(tmp_path / "run.csv", q, np.rad2deg(WRITE[written](R)), titles)
    with pytest.raises(InputError, match=rf"so they fit the joint angles to 0\.0.*call the columns .*_{written}_deg"):
        settle_turns(run, robot)


def test_angles_of_another_run_are_refused(tmp_path, robot):
    q, R = truth(robot, 1.0)
    titles = ["rx_deg", "ry_deg", "rz_deg"]
    other = write(tmp_path / "run.csv", q[::-1], np.rad2deg(WRITE["moving"](R)), titles)
    with pytest.raises(InputError, match="contradict the joint angles in every convention"):
        settle_turns(other, robot)


@pytest.mark.parametrize("order", ["xyzw", "wxyz"])
def test_quaternions_are_read_by_the_names_of_their_columns(tmp_path, robot, order):
    q, R = truth(robot, 1.0)
    quaternions = R.as_quat()[:, ["xyzw".index(c) for c in order]]
    run = settle_turns(write(tmp_path / "run.csv", q, quaternions, [f"q{c}" for c in order]), robot)
    assert off(run, R) < 1e-6
    rolled = write(tmp_path / "rolled.csv", q, np.roll(R.as_quat(), 1, axis=1), ["qx", "qy", "qz", "qw"])
    with pytest.raises(InputError, match="with w before x, y, z: so they fit"):
        settle_turns(rolled, robot)
    with pytest.raises(InputError, match=r"line 2, column 'qw': the quaternion has the length 0\.5"):
        write(tmp_path / "half.csv", q, quaternions / 2, [f"q{c}" for c in order])


def test_columns_that_say_two_conventions_are_refused(tmp_path, robot):
    q, R = truth(robot, 1.0)
    with pytest.raises(InputError, match="rx, ry, rz say different conventions: fixed, moving"):
        write(tmp_path / "run.csv", q, WRITE["fixed"](R), ["rx_fixed_deg", "ry_fixed_deg", "rz_moving_deg"])
