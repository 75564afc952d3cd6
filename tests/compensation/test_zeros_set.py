"""Zeros that were set in the controller are not corrected for once more: against an arm whose zeros truly are set."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from planner.common.files import data_folder
from planner.documents.expected_error import ExpectedError
from planner.documents.zeros_set import set_zeros
from planner.kinematics.robot import elementary_placement
from planner.kinematics.robot_reader import load_robot
from tests.command import edbb
from tests.compensation.robots import exact, flange_pose, regular_angles
from tests.not_everywhere import pin

Q = np.radians([[10, -80, 100, 20, 40, 30], [-20, -60, 80, 10, 50, -40], [35, -70, 60, -15, 60, 20]])
JOINTS = ",".join(f"q{k}_deg" for k in range(1, 7))
OFF = {2: 0.3, 3: -0.25, 5: 0.4}  # [deg] what the controller's angles of these joints lack
LENGTH = 0.4  # [mm] of which the upper arm is longer


def calibrated(path, name):
    """A calibrated robot whose zeros and upper arm are off, its file made by hand."""
    robot = load_robot(name)
    shift = robot.coupling_matrix @ np.radians([OFF.get(k, 0.0) for k in range(1, 7)])
    text, nominal = (data_folder("robots") / name / "robot.toml").read_text(), {}
    head, *joints = text.split("[[joints]]")
    for k, t in ((t.joint, t) for t in robot.transforms if t.joint is not None):
        said = _number(joints[k], "theta_deg")
        if shift[k]:
            joints[k] = _with(joints[k], "theta_deg", said + float(np.degrees(shift[k])))
            nominal[f"{t.name}_deg"] = said
    row = 2 if robot.convention == "mdh" else 1  # of a2
    a = _number(joints[row], "a_mm")
    joints[row] = _with(joints[row], "a_mm", a + LENGTH)
    nominal["a2_mm"] = a
    table = "\n[nominal]\n" + "".join(f"{key} = {value!r}\n" for key, value in nominal.items())
    path.write_text("[[joints]]".join([head, *joints]) + table)
    return path


def _number(table, key):
    line = next(line for line in table.splitlines() if line.startswith(key))
    return float(line.split("=")[1].split("#")[0])


def _with(table, key, value):
    return "\n".join(f"{key} = {value!r}" if line.startswith(key) else line for line in table.splitlines()) + "\n"


def controller_matrix(name):
    """How the axes of the maker's controller follow from the joints, by the words of the robot's file."""
    file = tomllib.loads((data_folder("robots") / name / "robot.toml").read_text())
    said = file["controllers"][file["dialect"]]
    M = np.eye(6) if said.get("same") else np.diag(np.array(said["sense"], dtype=float))
    for axis, other, factor in said.get("coupling", []):
        M[axis - 1] += factor * M[other - 1]
    return M


def left_of(name, axes):
    """What joints are off [deg] once the zeros of some of the controller's axes are set."""
    M, off = controller_matrix(name), np.array([OFF.get(k, 0.0) for k in range(1, 7)])
    shown = M @ off
    shown[[k - 1 for k in axes]] = 0.0
    return np.linalg.solve(M, shown)


def true_flange(name, q, left):
    """The arm itself, by pinocchio: longer, its joints off by ``left`` (6,) [deg] once some were set."""
    robot = load_robot(name)
    theta = robot.theta((q + np.radians(left))[None])[0]
    T = pin.SE3.Identity()
    for t in robot.transforms:
        value = t.nominal + (LENGTH / 1e3 if t.name == "a2" else 0.0) + (0.0 if t.joint is None else theta[t.joint])
        T = T * pin.SE3(elementary_placement(t, value))
    return T.homogeneous


@pytest.mark.parametrize("name", ["kuka-kr6-r700", "abb-irb120", "comau-nj130"])
@pytest.mark.parametrize("joints", [(2, 3, 5), (3,)])
def test_a_robot_whose_zeros_are_set_stands_where_the_nominal_one_should(name, joints, tmp_path):
    model = calibrated(tmp_path / "robot.toml", name)
    q = regular_angles(load_robot(name), 3, seed=3, margin=0.3)
    np.savetxt(tmp_path / "t.csv", np.degrees(q), "%.6f", ",", header=JOINTS, comments="")
    left = left_of(name, joints)
    found = {}
    for how, words in (("set", ("--zeros-set", ",".join(map(str, joints)))), ("not", ())):
        done = edbb("compensate", tmp_path / "t.csv", "--model", model, *words, "-o", "-")
        assert done.returncode == 0, done.stderr
        rows = [line for line in done.stdout.splitlines() if not line.startswith("#")]
        new = np.radians(np.loadtxt(rows, delimiter=",", skiprows=1))
        robot = load_robot(name)
        found[how] = max(
            np.linalg.norm((true_flange(name, b, left) - flange_pose(exact(robot), a))[:3, 3])
            for a, b in zip(q, new, strict=True)
        )
        assert ("are set in the controller" in " ".join(done.stdout.replace("#", "").split())) == (how == "set")
    assert found["set"] < 1e-6
    assert found["not"] > 1e-3  # both at once: the zeros are corrected twice


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("9", "has the axes 1 to 6"),
        ("1", "its zero is not off"),
        ("two", "numbers of axes are allowed"),
        ("٣", "numbers of axes"),
    ],
)
def test_zeros_that_cannot_have_been_set_are_refused(words, said, tmp_path):
    model = calibrated(tmp_path / "robot.toml", "kuka-kr6-r700")
    np.savetxt(tmp_path / "t.csv", np.degrees(Q), "%.6f", ",", header=JOINTS, comments="")
    done = edbb("compensate", tmp_path / "t.csv", "--model", model, "--zeros-set", words, "-o", "-")
    assert (done.returncode, said in " ".join(done.stderr.split())) == (2, True), done.stderr


def test_only_a_server_knows_that_a_robot_has_changed(tmp_path):
    model = calibrated(tmp_path / "robot.toml", "kuka-kr6-r700")
    np.savetxt(tmp_path / "t.csv", np.degrees(Q), "%.6f", ",", header=JOINTS, comments="")
    done = edbb("compensate", tmp_path / "t.csv", "--model", model, "--despite-change", "-o", "-")
    assert (done.returncode, "only a server" in " ".join(done.stderr.split())) == (2, True), done.stderr


def test_the_error_before_is_that_of_the_robot_with_its_zeros_set(tmp_path):
    """Where the zeros are all that is off, the robot is as good before as after once they are set."""
    model = calibrated(tmp_path / "robot.toml", "kuka-kr6-r700")
    robot = load_robot(str(model))
    shift = robot.coupling_matrix @ np.radians([OFF.get(k, 0.0) for k in range(1, 7)])
    names = [f"theta{k}" for k in range(1, 7)]
    content = {
        "schema": "edbb-expected-error/1", "robot": robot.name, "robot_sha256": "0" * 64, "tool_mm": [10, 0, 100],
        "parameters": [{"name": n} for n in names], "nominal": (-shift).tolist(), "geometry": [0.0] * 6,
        "released": [0.0] * 6, "spread": [[1e-5 * (j == k) for j in range(6)] for k in range(6)], "rest_mm": 0.001,
        "rest_other_mm": 0.001, "states_deg": np.degrees(Q).tolist(),
    }  # fmt: skip
    (tmp_path / "expected_error.json").write_text(json.dumps(content | {"robot_sha256": _hash(model)}))
    known = ExpectedError.read(robot, model)
    _, after = set_zeros(robot, known, (2, 3, 5))
    assert isinstance(known, ExpectedError)
    assert isinstance(after, ExpectedError)
    before, now = known.at(Q, known.tool), after.at(Q, after.tool)
    assert before.nominal.max() > 2e-4
    np.testing.assert_allclose(now.nominal, now.released, rtol=1e-6)
    np.testing.assert_allclose(now.released, before.released, rtol=1e-9)
    assert replace(robot, path=model).n_joints == 6


def _hash(path):
    from hashlib import sha256

    return sha256(path.read_bytes()).hexdigest()
