"""The calibrated robot's files against the model's own prediction and against pinocchio."""

from pathlib import Path

import numpy as np
import pytest

import planner
import planner.effects.basis as basis
import planner.effects.compliance as compliance
import planner.effects.sessions as sessions
import tests.identification.calibrated.made as making
from planner.cell.placement import Targets
from planner.documents.calibrated_robot import (
    CalibratedRobot,
    calibrated_files,
    calibrated_meshes,
    uncorrected_text,
)
from planner.effects.basis import FUNCTIONS
from planner.effects.phi_keys import is_static, key_patterns, phi_from_key
from planner.kinematics.robot import RobotEffect
from planner.kinematics.robot_reader import list_robots, load_robot
from planner.motion.collision.engines import pin_model
from planner.runs.run import Samples
from tests.cell.test_robots import urdf_text
from tests.identification.calibrated.made import (
    calibration,
    compliances,
    parameter,
    poses,
    predicted,
    robot_called,
    write,
)
from tests.identification.calibrated.test_keys import KEYS
from tests.not_everywhere import pin

URDFS = ["panda.urdf", "slanted"]
EVERY = [*list_robots(), *URDFS]


def turned(rpy):
    """Roll, pitch, yaw as a matrix, by exponentials."""
    r, p, y = (pin.exp3(angle * axis) for angle, axis in zip(rpy, np.eye(3), strict=True))
    return y @ p @ r


def back(tmp_path, made):
    folder = tmp_path / "out"
    folder.mkdir()
    write(folder, calibrated_files(made))
    return load_robot("robot.toml", folder)


@pytest.mark.parametrize("name", EVERY)
def test_the_file_gives_the_flange_of_the_fitted_model(name, tmp_path):
    robot = robot_called(name, tmp_path)
    made = calibration(robot, seed=1)
    again = back(tmp_path, made)
    q = poses(robot)
    p, _ = CalibratedRobot(again).flange(q)
    np.testing.assert_allclose(p, predicted(made, q), rtol=0, atol=1e-9)
    rigid = again.chain.forward(again.theta(q)).x.T
    np.testing.assert_array_equal(p, rigid)
    nominal = robot.chain.forward(robot.theta(q)).x.T
    assert np.linalg.norm(p - nominal, axis=1).max() > 1e-3
    kept = again.nominal_robot.chain.forward(again.nominal_robot.theta(q)).x.T
    np.testing.assert_allclose(kept, nominal, rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", EVERY)
def test_all_else_is_kept(name, tmp_path):
    robot = robot_called(name, tmp_path)
    again = back(tmp_path, calibration(robot, seed=2))
    for what in ("q_lower", "q_upper", "speed", "acceleration", "jerk", "coupling_matrix", "theta_zero"):
        np.testing.assert_array_equal(getattr(again, what), getattr(robot, what))
    for what in ("name", "title", "convention", "repeatability", "payload", "gear_ratio", "never_meet", "tip"):
        assert getattr(again, what) == getattr(robot, what), what
    assert [(link, b.name, b.kind, b.size) for link, b in again.bodies] == [
        (link, b.name, b.kind, b.size) for link, b in robot.bodies
    ]
    masses = [None if m is None else (m.mass, *m.com) for m in robot.masses]
    assert [None if m is None else (m.mass, *m.com) for m in again.masses] == masses
    assert set(robot.sources) < set(again.sources)
    assert "monday.csv" in dict(again.sources)["calibration"]
    text = (tmp_path / "out" / "robot.toml").read_text()
    assert str(tmp_path) not in text
    assert str(Path(planner.__file__).parents[1]) not in text


@pytest.mark.parametrize("name", URDFS)
def test_any_reader_of_urdf_files_has_the_calibrated_geometry(name, tmp_path):
    robot = robot_called(name, tmp_path)
    made = calibration(robot, seed=3)
    again = back(tmp_path, made)
    model = pin.buildModelFromUrdf(str(tmp_path / "out" / "robot.urdf"))
    data, frame = model.createData(), model.getFrameId(again.tip)
    q = poses(robot, 20)
    found = []
    for row in q:
        pin.framesForwardKinematics(model, data, np.concatenate([row, np.zeros(model.nq - len(row))]))
        found.append(data.oMf[frame].translation.copy())
    np.testing.assert_allclose(np.array(found), predicted(made, q), rtol=0, atol=1e-9)


def test_a_frame_whose_pitch_comes_to_90_degrees(tmp_path):
    text = urdf_text(making.SLANTED).replace('rpy="0.6 0.2 -0.5"', f'rpy="0.6 {np.pi / 2 - 1e-9} -0.5"')
    (tmp_path / "steep.urdf").write_text(text)
    robot = load_robot("steep.urdf", tmp_path)
    made = calibration(robot, seed=4)
    made.fit.errors[:] *= 1e-5
    made.estimates = making.estimates_of(made)
    q = poses(robot)
    p, _ = CalibratedRobot(back(tmp_path, made)).flange(q)
    np.testing.assert_allclose(p, predicted(made, q), rtol=0, atol=1e-9)


def deflected(robot, calibrated, compliance, q):
    """The flange by pinocchio: torques on the nominal arm with tool, joints turned by compliance times torque."""
    model, frames = pin_model(robot)
    joint, T_last = frames[-1]
    T_flange = T_last * pin.SE3(robot.flange_frame())
    model.appendBodyToJoint(joint, pin.Inertia(making.MASS, making.COM, np.zeros((3, 3))), T_flange)
    model.gravity.linear = making.gravity(making.TILT)
    data, zero = model.createData(), np.zeros(model.nv)
    real, real_frames = pin_model(calibrated)
    real_data, p, R = real.createData(), [], []
    for theta in robot.theta(q):
        torque = -pin.rnea(model, data, theta, zero, zero)
        pin.forwardKinematics(real, real_data, theta + compliance * torque)
        T = real_data.oMi[real_frames[-1][0]] * real_frames[-1][1] * pin.SE3(calibrated.flange_frame())
        p.append(T.translation.copy())
        R.append(T.rotation.copy())
    return np.array(p), np.array(R)


@pytest.mark.parametrize("name", EVERY)
def test_compliance_turns_the_joints_as_pinocchio_says(name, tmp_path):
    robot = robot_called(name, tmp_path)
    made = calibration(robot, 6, compliances(robot))
    again = back(tmp_path, made)
    q = poses(robot)
    p, R = CalibratedRobot(again).flange(q)
    compliance = made.fit.errors[-robot.n_joints :]
    p_pin, R_pin = deflected(robot, again, compliance, q)
    np.testing.assert_allclose(p, p_pin, rtol=0, atol=1e-9)
    np.testing.assert_allclose(R, R_pin, rtol=0, atol=1e-9)
    np.testing.assert_allclose(p, predicted(made, q), rtol=0, atol=1e-9)
    rigid = again.chain.forward(again.theta(q)).x.T
    assert np.linalg.norm(p - rigid, axis=1).max() > 1e-6
    assert again.nominal_robot.effects == ()
    up = turned(again.loads.base_rpy).T @ [0, 0, 1]  # the turn about the vertical is free
    np.testing.assert_allclose(up, turned(making.TILT).T @ [0, 0, 1], atol=1e-12)


def test_a_second_calibration_keeps_the_controllers_model(tmp_path):
    robot = load_robot("comau-nj130")
    first = back(tmp_path, calibration(robot, 7, compliances(robot)))
    made = calibration(first, 8)
    (tmp_path / "b").mkdir()
    second = back(tmp_path / "b", made)
    q = poses(robot)
    np.testing.assert_allclose(CalibratedRobot(second).flange(q)[0], predicted(made, q), rtol=0, atol=1e-9)
    assert second.effects == ()  # they were not in this fit
    heads = [(tmp_path / f / "robot.toml").read_text().partition("schema")[0] for f in ("out", "b/out")]
    assert heads[0] == heads[1].replace("samples: geometry.", "samples: geometry; joint compliance.")
    assert "Marwitz" in heads[0]
    nominal = [t.nominal for t in second.nominal_robot.transforms]
    np.testing.assert_allclose(nominal, [t.nominal for t in robot.transforms], rtol=0, atol=1e-11)


def test_effects_that_need_more_than_angles_and_loads_are_named_and_left_out(tmp_path):
    robot = load_robot("ur10")
    made = calibration(robot, 9, [parameter(robot, "step", "rad", "theta2", sessions.InSession(0), "session step")])
    again = back(tmp_path, made)
    assert [(e.name, e.on, e.phi, e.unit, e.static) for e in again.effects] == [
        ("step", "theta2", "session:0", "rad", False)
    ]
    assert again.effects[0].value == pytest.approx(made.fit.errors[-1], rel=1e-11)
    calibrated = CalibratedRobot(again)
    assert [e.name for e in calibrated.uncorrected_effects] == ["step"]
    assert "step" in calibrated.sentence
    q = poses(robot)
    np.testing.assert_array_equal(calibrated.flange(q)[0], again.chain.forward(again.theta(q)).x.T)


def test_what_belongs_to_the_gauge_stays_out(tmp_path):
    robot = load_robot("ur10")
    sag = parameter(robot, "sag", "m", "map_z", basis.ONE, "gauge sag")
    shift = parameter(robot, "shift", "m", "base_x", basis.AtPlace(0), "fixture")
    made = calibration(robot, 9, [sag, shift])
    assert back(tmp_path, made).effects == ()


def test_an_effect_on_the_base_moves_the_whole_arm(tmp_path):
    robot = load_robot("ur10")
    made = calibration(robot, 9, [parameter(robot, "foundation", "rad/Nm", "base_ry", compliance.LoadTorque(1))])
    again = back(tmp_path, made)
    q = poses(robot)
    np.testing.assert_allclose(CalibratedRobot(again).flange(q)[0], predicted(made, q), rtol=0, atol=1e-9)


def test_meshes_go_along(tmp_path):
    for side in ("a", "b"):
        (tmp_path / side).mkdir()
        (tmp_path / side / "link.stl").write_bytes(f"solid {side}\nendsolid {side}\n".encode())
    text = urdf_text(["0 0 1"] * 6, "package://a/link.stl").replace("a/link.stl", "b/link.stl", 1)
    (tmp_path / "six.urdf").write_text(text)
    robot = load_robot("six.urdf", tmp_path)
    made = calibration(robot, 1)
    (tmp_path / "out").mkdir()
    write(tmp_path / "out", calibrated_meshes(made))
    write(tmp_path / "out", calibrated_files(made))
    again = load_robot("robot.toml", tmp_path / "out")
    content = [b.mesh.read_bytes() for _, b in again.bodies]
    assert content == [b.mesh.read_bytes() for _, b in robot.bodies]
    assert len(set(content)) == 2
    assert all(b.mesh.is_relative_to(tmp_path / "out") for _, b in again.bodies)


def test_a_robot_file_that_points_at_a_urdf(tmp_path):
    text = urdf_text(["0 0 1", "0.6 0 0.8", "0 1 0", "1 0 0", "0 1 1", "1 0 0"])
    (tmp_path / "arm").mkdir()
    (tmp_path / "arm" / "six.urdf").write_text(text)
    (tmp_path / "arm" / "hand.stl").write_bytes(b"solid hand\nendsolid hand\n")
    joints = (
        "[[joints]]\nlimit_deg = [-90, 80]\nspeed_deg_s = 90\nacceleration_deg_s2 = 300\njerk_deg_s3 = 3000\n"
        "zero_deg = 7\n"
    )
    (tmp_path / "arm" / "robot.toml").write_text(
        '# bought used\n\nschema = "edbb-robot/1"\nname = "six"\nconvention = "urdf"\nurdf = "six.urdf"\n'
        + "[flange]\nposition_mm = [10, 0, 30]\nrpy_deg = [0, 20, 0]\n"
        + joints * 5
        + joints
        + "couple = {5 = 0.5}\n"
        + '[[bodies]]\nlink = 6\nkind = "mesh"\nfile = "hand.stl"\n'
    )
    robot = load_robot("robot.toml", tmp_path / "arm")
    made = calibration(robot, 11, compliances(robot))
    (tmp_path / "out").mkdir()
    write(tmp_path / "out", (*calibrated_meshes(made), *calibrated_files(made)))
    again = load_robot("robot.toml", tmp_path / "out")
    q = poses(robot)
    np.testing.assert_allclose(CalibratedRobot(again).flange(q)[0], predicted(made, q), rtol=0, atol=1e-9)
    assert [b.mesh.name for _, b in again.bodies] == ["hand.stl"]
    np.testing.assert_array_equal(again.coupling_matrix, robot.coupling_matrix)
    assert "# bought used" in (tmp_path / "out" / "robot.toml").read_text()


def test_the_same_calibration_gives_the_same_bytes():
    robot = load_robot("kuka-kr6-r700")
    one, two = (calibrated_files(calibration(robot, 3, compliances(robot))) for _ in range(2))
    assert one == two


def test_what_is_called_static_needs_nothing_but_angles_and_loads(tmp_path):
    """Each is tried on samples that carry nothing else."""
    robot = load_robot("ur10")
    on = [parameter(robot, f"p{i}", "rad", "theta2", phi_from_key(k)) for i, k in enumerate(KEYS) if is_static(k)]
    assert len(on) > 8
    made = calibration(robot, 12, on)
    made.fit.errors[:] *= 1e-3
    made.estimates = making.estimates_of(made)
    q = poses(robot)
    made.samples = Samples(q, np.zeros(len(q), dtype=int), payload=np.zeros(len(q)))
    p, _ = CalibratedRobot(back(tmp_path, made)).flange(q)
    at_base = Targets(position=np.zeros((len(q), 3)))
    expected = -made.fit.model.residual(made.samples, at_base, made.fit.errors)
    np.testing.assert_allclose(p, expected, rtol=0, atol=1e-9)


def test_what_programs_are_not_corrected_for_is_told_by_cause_and_place():
    def effect(on, phi):
        return RobotEffect(f"raw_{on}", on, phi, 1.0, "m", False)

    effects = [effect(f"base_{axis}", "warm-up:0.0:55.6") for axis in "xyz"]
    effects += [effect(on, "warm-up:0.0:55.6") for on in ("d3", "a2", "d2")]
    effects += [
        effect("theta3", "approach:3"),
        effect("theta1", "times:0.5:speed-sign:1"),
        effect("theta2", "approach:2"),
    ]
    assert uncorrected_text(effects) == (
        "not corrected: warming up (base; links 2, 3), play (joints 2, 3), what depends on the sense of "
        "motion (joint 1): it depends on more than joint angles and loads"
    )
    assert uncorrected_text([]) is None


def test_every_effect_that_programs_are_not_corrected_for_has_a_cause():
    assert key_patterns()
    own = [f for f in FUNCTIONS if not f.is_static and not f.of_gauge]
    assert len(own) == 11
    assert all(f.uncorrected for f in own)
    assert {f for f in FUNCTIONS if f.uncorrected} == set(own)
