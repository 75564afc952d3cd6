"""The identification Jacobian against finite differences of the residual, the load torques against pin's rnea."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tests.identification.rigs as rigs
from planner.effects.context import Context
from planner.model.model import Model
from planner.motion.collision.engines import pin_model
from tests.not_everywhere import pin

STEP = {"m": 1e-5, "rad": 1e-5, "rad/Nm": 1e-8, "1": 1e-5}


def differences(model: Model, s, t, errors):
    """Central differences of minus the residual, (n, r, P): fourth order, so that steps may be large."""
    columns = []
    for j, p in enumerate(model.parameters):
        h = STEP[p.unit] * np.eye(len(errors))[j]
        at = [model.residual(s, t, errors + k * h) for k in (-2, -1, 1, 2)]
        columns.append(-(at[0] - 8 * at[1] + 8 * at[2] - at[3]) / (12 * STEP[p.unit]))
    return np.stack(columns, axis=2)


@pytest.mark.slow
@pytest.mark.parametrize("kind", rigs.KINDS)
@pytest.mark.parametrize("name", ["comau-nj130", "kuka-kr6-r700"])
def test_rows_are_the_derivative_of_the_prediction(name, kind):
    rng = np.random.default_rng(5)
    setup = rigs.setup(name, kind, rng)
    model, s = rigs.whole_model(setup), rigs.samples(setup.robot, 40, rng, force=kind == "length")
    errors = model.prior * rng.normal(0.0, 0.3, len(model.names))
    # a probe's turn is read by its logarithm: rows are exact where prediction and reading agree
    target = agreeing(model, s, errors) if kind == "pose" else rigs.targets(setup, kind, s, rng)
    rows, found = model.rows(s, errors), differences(model, s, target, errors)
    size = np.abs(rows).max(axis=(0, 1))
    assert np.all(size > 0), [n for n, v in zip(model.names, size, strict=True) if v == 0]
    off = np.abs(rows - found).max(axis=(0, 1)) / size
    worst = int(np.argmax(off))
    assert off[worst] < 2e-7, (model.names[worst], off[worst])


def agreeing(model, s, errors):
    """Targets that the robot with these errors meets exactly, read off the residual from the base frame itself."""
    here = rigs.Targets(position=np.zeros((len(s), 3)), rotation=np.broadcast_to(np.eye(3), (len(s), 3, 3)))
    off = model.residual(s, here, errors)
    return rigs.Targets(position=-off[:, :3], rotation=Rotation.from_rotvec(-off[:, 3:]).as_matrix())


@pytest.mark.parametrize("kind", rigs.KINDS)
def test_residuals_are_what_the_readings_are_off_by(kind):
    """Readings written down in the gauge's own frame, off by 1 mm and 1 mrad an axis, come back as that."""
    rng = np.random.default_rng(4)
    setup = rigs.setup("ur10", kind, rng)
    s = rigs.samples(setup.robot, 400, rng, force=False)
    off = Model.of(setup, frozenset()).subset([]).residual(s, rigs.targets(setup, kind, s, rng), np.zeros(0))
    assert off.shape == (400, {"length": 1, "pose": 6}.get(kind, 3))
    assert np.allclose(off.std(axis=0), 1e-3, rtol=0.15)


@pytest.mark.parametrize("kind", rigs.KINDS)
def test_every_kind_frees_what_places_it(kind):
    """Six numbers a frame or three a fixture, three a target: a column each that no other sample moves."""
    rng = np.random.default_rng(6)
    setup = rigs.setup("ur10", kind, rng)
    model, s = rigs.whole_model(setup), rigs.samples(setup.robot, 30, rng, force=False)
    rows = model.rows(s)
    of_place = [j for j, n in enumerate(model.names) if "_B_" in n]
    assert len(of_place) == (3 if kind == "length" else 6)
    assert np.all(rows[s.place != 1][:, :, of_place] == 0)
    assert np.all(np.abs(rows[s.place == 1][:, :, of_place]).max(axis=(0, 1)) > 0)
    of_point = [j for j, n in enumerate(model.names) if n.startswith("map_right")]
    assert len(of_point) == 3
    assert np.all(rows[s.point != 1][:, :, of_point] == 0)


def test_joint_rows_are_the_derivative_by_the_controllers_angles():
    rng = np.random.default_rng(7)
    setup = rigs.setup("kuka-kr6-r700", "length", rng)
    coupled = setup.robot.coupling_matrix.copy()
    coupled[2, 1] = 0.7
    setup = replace(setup, robot=replace(setup.robot, coupling_matrix=coupled))
    model, s = Model.of(setup, frozenset()), rigs.samples(setup.robot, 20, rng, force=False)
    rows = model.joint_rows(s)
    zero = rigs.Targets(length=np.zeros(len(s)))
    for j in range(6):
        h = 1e-6 * np.eye(6)[j]
        up, down = (model.residual(replace(s, q=s.q + k * h), zero) for k in (1, -1))
        assert np.allclose(rows[:, :, j], (down - up) / 2e-6, atol=1e-8)


@pytest.mark.parametrize("name", rigs.ROBOTS)
def test_load_torques_are_those_of_newton_and_euler(name):
    """pin's own model with our masses; payload as one more body, the bar's pull as a force on the tool point."""
    rng = np.random.default_rng(8)
    setup = rigs.setup(name, "length", rng)
    robot, n = setup.robot, 25
    if all(m is None for m in robot.masses):
        pytest.skip(f"{name} ships without masses")
    s = rigs.samples(robot, n, rng)
    found = Context(setup, s).load_torque
    theta = robot.theta(s.q)
    for k in range(n):
        model, frames = pin_model(robot)
        parent, T = frames[-1]
        T_F = T * pin.SE3(robot.flange_frame())
        model.appendBodyToJoint(
            parent, pin.Inertia(float(s.payload[k] + setup.tool_mass), setup.com_F, np.zeros((3, 3))), T_F
        )
        model.gravity.linear = setup.gravity_B
        data = model.createData()
        held = pin.rnea(model, data, theta[k], np.zeros(6), np.zeros(6))
        pulled = -held + _pulled(model, data, theta[k], parent, T_F, setup, s, k)
        assert np.allclose(found[k], pulled, rtol=0, atol=1e-9 * np.abs(pulled).max())


def _pulled(model, data, theta, parent, T_F, setup, s, k):
    """Torques of the pull on the tool point, by pin's frame Jacobian."""
    place = T_F * pin.SE3(np.eye(3), setup.p_FM[s.point[k]])
    frame = model.addFrame(pin.Frame("map", parent, place, pin.FrameType.OP_FRAME))
    data = model.createData()
    J = pin.computeFrameJacobian(model, data, theta, frame, pin.LOCAL_WORLD_ALIGNED)[:3]
    pin.framesForwardKinematics(model, data, theta)
    bar = setup.p_BX[s.place[k]] - data.oMf[frame].translation
    return s.force[k] * J.T @ bar / np.linalg.norm(bar)


def test_a_logged_payload_comes_on_top_of_the_tool():
    rng = np.random.default_rng(9)
    setup = rigs.setup("comau-nj130", "length", rng)
    s = rigs.samples(setup.robot, 5, rng, force=False)
    logged = Context(setup, replace(s, payload=np.zeros(5))).load_torque
    assert np.allclose(Context(setup, replace(s, payload=None)).load_torque, logged, atol=1e-12)
