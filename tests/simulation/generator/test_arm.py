"""The arm is checked against pin, its moments against virtual work, its columns against finite differences."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from tests.not_everywhere import pin
from tests.simulation.generator.arm import ROBOTS, Arm, moment_of_weight
from tests.simulation.generator.poses import uniform
from tests.simulation.generator.shared import NAMES, arm, run


def pin_arm(name, errors):
    """The same table through pinocchio: model, and the flange in the last joint."""
    data = tomllib.loads((ROBOTS / name / "robot.toml").read_text())
    model, place, parent = pin.Model(), pin.SE3.Identity(), 0

    def turn(axis, angle):
        return pin.SE3(pin.exp3(angle * np.eye(3)[axis]), np.zeros(3))

    def shift(axis, way):
        return pin.SE3(np.eye(3), way * np.eye(3)[axis])

    for i, j in enumerate(data["joints"], 1):
        k = i if data["convention"] == "dh" else i - 1
        value = {
            f"{n}{k if n in ('alpha', 'a', 'beta') else i}": v
            for n, v in (
                ("alpha", np.radians(j["alpha_deg"])), ("a", j["a_mm"] / 1e3), ("beta", 0.0),
                ("theta", np.radians(j["theta_deg"])), ("d", j["d_mm"] / 1e3),
            )
        }  # fmt: skip
        alpha, a, beta, theta, d = (v + errors.get(n, 0.0) for n, v in value.items())
        link = [turn(0, alpha), shift(0, a), turn(1, beta)]
        if data["convention"] == "dh":
            place = place * turn(2, theta)
            parent = model.addJoint(parent, pin.JointModelRZ(), place, f"j{i}")
            place = shift(2, d) * shift(0, a) * turn(0, alpha) * turn(1, beta)
        else:
            place = place * link[0] * link[1] * link[2] * turn(2, theta)
            parent = model.addJoint(parent, pin.JointModelRZ(), place, f"j{i}")
            place = shift(2, d)
        inertia = pin.Inertia(j["mass_kg"], np.array(j["com_mm"]) / 1e3, np.zeros((3, 3)))
        model.appendBodyToJoint(parent, inertia, place)
    flange = data["flange"]
    rpy = np.radians(flange["rpy_deg"])
    return model, place * pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(flange["position_mm"]) / 1e3)


@pytest.mark.parametrize("name", NAMES)
def test_flange_and_torques_are_those_of_pin(name):
    rng = np.random.default_rng(1)
    errors = {n: rng.normal(0, 2e-3) for n in arm(name).geometry}
    q = uniform(arm(name), 20, rng)
    model, last = pin_arm(name, errors)
    data = model.createData()
    R, p = arm(name).flange(q, errors)
    names = [f"theta{i + 1}" for i in range(6)]
    stance = arm(name).walk(q, errors, names)
    mass = arm(name).mass
    moments = np.stack([moment_of_weight(arm(name), stance, n, mass) for n in names], axis=1)
    model.gravity.linear = np.array([0, 0, -9.81])
    for k in range(len(q)):
        pin.forwardKinematics(model, data, q[k])
        T = data.oMi[6] * last
        assert np.allclose(T.rotation, R[k], atol=1e-12)
        assert np.allclose(T.translation, p[k], atol=1e-12)
        held = pin.rnea(model, data, q[k], np.zeros(6), np.zeros(6))
        assert np.allclose(-moments[k], held, atol=1e-9 * np.abs(held).max())


def test_controller_angles_follow_sense_zero_and_coupling(tmp_path):
    text = (ROBOTS / "abb-irb120" / "robot.toml").read_text()
    head, *joints = text.split("[[joints]]")
    joints[2] = (
        joints[2].replace("sense = 1", "sense = -1\ncouple = {2 = 0.5}").replace("zero_deg = 0", "zero_deg = 10")
    )
    (tmp_path / "robot.toml").write_text("[[joints]]".join([head, *joints]))
    other = Arm.from_toml(tmp_path / "robot.toml")
    q = uniform(other, 5, np.random.default_rng(0))
    plain = q.copy()
    plain[:, 2] = -(q[:, 2] - np.radians(10) + 0.5 * q[:, 1])
    assert np.allclose(other.flange(q)[1], arm("abb-irb120").flange(plain)[1], atol=1e-13)


def test_unknown_errors_are_refused():
    with pytest.raises(KeyError, match="gamma3"):
        arm("ur10").flange(np.zeros((1, 6)), {"gamma3": 0.1})


@pytest.mark.parametrize("slot", ["base_rx", "theta2", "beta2", "alpha3", "tilt_y4", "theta5", "tool_ry"])
def test_moments_are_the_fall_of_potential_energy(slot):
    scene = run("edbb").scene
    u, v = 1e-5, scene.arm

    def energy(value):
        stance = v.walk(scene.q, {slot: value})
        com = stance.p + np.einsum("ijn,j->in", stance.R, scene.tool_com)
        weight = np.einsum("l,ln->n", scene.mass, stance.centres[:, 2]) + (scene.tool_mass + scene.payload) * com[2]
        x = stance.p + np.einsum("ijn,j->in", stance.R, scene.tool)
        return 9.81 * weight + scene.force * np.linalg.norm(x - scene.fixture[:, None], axis=0)

    fall = -(energy(u) - energy(-u)) / (2 * u)
    assert np.allclose(scene.moments(slot), fall, rtol=1e-6, atol=1e-5 * np.abs(fall).max())
    assert np.abs(fall).max() > 0.1


@pytest.mark.parametrize("what", ["edbb", "tracker", "balls"])
@pytest.mark.parametrize("name", ["comau-nj130", "kuka-kr6-r700"])
def test_columns_are_finite_differences(what, name):
    m = run(what, name)
    J, names = m.geometry
    errors, scene, station, h = m.truth.of_arm(scene_arm := m.scene.arm), m.scene, m.station, 1e-6
    assert scene_arm.geometry == names[: len(scene_arm.geometry)]
    for k, n in enumerate(names):
        if n in scene_arm.names:
            ends = [station.read(scene.points({**errors, n: errors[n] + s * h})) for s in (1, -1)]
        elif n.startswith("map_"):
            step = h * np.eye(3)["xyz".index(n[-1])]
            ends = [station.read(replace(scene, tool=scene.tool + s * step).points(errors)) for s in (1, -1)]
        elif n.startswith("fixture"):
            step = h * np.eye(3)["xyz".index(n[-1])]
            ends = [replace(station, place=station.place + s * step).read(scene.points(errors)) for s in (1, -1)]
        else:
            continue
        assert np.allclose(J[..., k], (ends[0] - ends[1]) / (2 * h), atol=1e-8), n
