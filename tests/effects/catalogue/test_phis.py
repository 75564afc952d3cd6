"""Every basis function of the catalogue: its column against finite differences, its values against other ways."""

from dataclasses import replace

import numpy as np
import pytest

import tests.identification.rigs as rigs
from planner.effects.backlash import ApproachDirection, Hysteresis, SettlingError, SpeedLag, SpeedSign, TorqueSign
from planner.effects.basis import ONE, Less
from planner.effects.catalogue import Excitation, catalogue
from planner.effects.compliance import DriveTorque, LoadMoment, PayloadTorque, TipMoment, WeightTorque, twist_moves
from planner.effects.context import Context
from planner.effects.drift_shapes import TimeWave
from planner.effects.effect import Parameter, transform_move
from planner.effects.gauge_errors import (
    BallOffset,
    BarSag,
    BeamRefraction,
    GaugeRay,
    LengthGrowth,
    LengthLag,
    LengthPower,
    PointLag,
    RayGrowth,
)
from planner.effects.gauge_shapes import BarShape, HangingShape
from planner.effects.gears import BoundedWave, JointAngle, JointWave
from planner.effects.phi_keys import phi_from_key
from planner.effects.sessions import PlaceInSession
from planner.effects.thermal import ElapsedTime, TemperatureRise, WarmUp
from planner.model.model import Model
from planner.motion.collision.engines import pin_model
from planner.runs.run import Samples
from tests.identification.test_jacobian import agreeing
from tests.not_everywhere import pin
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.benches import BENCHES
from tests.simulation.generator.scene import Scene


def everything(setup, n, rng):
    """Samples with every column, all of them at random."""
    s = rigs.samples(setup.robot, n, rng, force=setup.gauge.is_attached)
    N = setup.robot.n_joints
    return Samples(
        **{
            **vars(s),
            "t": np.sort(rng.uniform(0, 3600, n)),
            "q_cmd": s.q + rng.normal(0, 1e-3, (n, N)),
            "q_read": s.q,
            "session": rng.integers(0, 3, n),
            "temperature": rng.uniform(18, 30, n),
            "torque": rng.normal(0, 100, (n, N)),
            "direction": rng.choice([-1.0, 1.0], (n, N)),
            "speed": rng.normal(0, 0.5, (n, N)),
            "length": rng.uniform(0.3, 0.5, n) if setup.gauge.is_attached else None,
            "reversals": s.q[:, :, None] + rng.normal(0, 0.1, (n, N, 3)),
        }
    )


def column_and_differences(setup, s, target, parameter):
    """Column (n, r) of one parameter, and fourth-order differences of minus the residual, about a value of its size."""
    model = Model(setup, (parameter,))
    at, h = 0.3 * parameter.prior, 0.3 * parameter.prior
    target = agreeing(model, s, np.array([at])) if setup.gauge.angles else target
    moved = [model.residual(s, target, np.array([at + k * h])) for k in (-2, -1, 1, 2)]
    found = -(moved[0] - 8 * moved[1] + 8 * moved[2] - moved[3]) / (12 * h)
    return model.rows(s, np.array([at]))[:, :, 0], found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("comau-nj130", "length"),
        ("kuka-kr6-r700", "position"),
        pytest.param("comau-nj130", "pose", marks=pytest.mark.long),
    ],
)
def test_columns_are_the_derivative_of_the_prediction(name, kind):
    rng = np.random.default_rng(3)
    setup = rigs.setup(name, kind, rng)
    s = everything(setup, 12, rng)
    entries = catalogue(setup, s)
    values = [None if e.nonlinear is None else float(rng.choice(e.nonlinear.values)) for e in entries]
    parameters = [p for e, v in zip(entries, values, strict=True) for p in e.make(v)]
    assert len({p.name for p in parameters}) == len(parameters) > 150
    target = rigs.targets(setup, kind, s, rng)
    for p in parameters:
        column, found = column_and_differences(setup, s, target, p)
        size = np.abs(column).max()
        assert size > 0, p.name
        assert np.abs(column - found).max() < 2e-5 * size, p.name


def test_keys_tell_functions_apart_and_lead_back_to_them():
    rng = np.random.default_rng(4)
    phis = set()
    for kind in ("length", "position"):
        setup = rigs.setup("comau-nj130", kind, rng)
        for e in catalogue(setup, everything(setup, 30, rng)):
            for v in [None] if e.nonlinear is None else e.nonlinear.values[:3]:
                phis |= {m.phi for p in e.make(None if v is None else float(v)) for m in p.moves}
    phis |= {TipMoment(0), TipMoment(1)}
    keys = {phi.key for phi in phis}
    assert len(keys) == len(phis) > 150
    assert all(phi_from_key(phi.key, 6) == phi for phi in phis)


def context(name="comau-nj130", kind="length", n=40, seed=5):
    rng = np.random.default_rng(seed)
    setup = rigs.setup(name, kind, rng)
    return Context(setup, everything(setup, n, rng))


def scene_of(name, q, payload, force):
    """The generator's scene of an arm, weights as the planner has them."""
    arm, bench = Arm.from_toml(name), BENCHES[name]
    none = np.zeros(len(q))
    return Scene(
        arm, "edbb", False, none, q, q, 0 * q, 0 * q, none, none, payload, force,
        bench.fixture, bench.tool, 0.0, np.array(bench.com_mm) / 1e3, arm.mass,
    )  # fmt: skip


@pytest.mark.parametrize("name", ["comau-nj130", "kuka-kr6-r700", "ur10"])
def test_moments_are_those_of_the_generators_own_physics(name):
    """About base, tool and link axes, with payload and the bar's pull; it shares no code with the planner."""
    rng = np.random.default_rng(6)
    bench, setup = BENCHES[name], rigs.setup(name, "length", rng)
    setup = replace(
        setup, p_BX=bench.fixture[None], p_FM=bench.tool[None], com_F=np.array(bench.com_mm) / 1e3,
        gravity_B=np.array([0, 0, -9.81]), place_names=("A",), point_names=("",), tool_mass=0.0,
    )  # fmt: skip
    q = rng.uniform(setup.robot.q_lower, setup.robot.q_upper, (30, 6))
    payload, force = rng.uniform(0, 6, 30), rng.uniform(0, 500, 30)
    c = Context(setup, Samples(q, np.zeros(30, dtype=int), payload=payload, force=force))
    scene = scene_of(name, q, payload, force)
    slots = {"base_rx": (0, 0), "base_ry": (0, 1), "tool_rx": (7, 0), "tool_ry": (7, 1)}
    slots |= {f"beta{i}": (i + 1, 1) for i in range(1, 6)}
    for slot, (station, axis) in slots.items():
        expected = scene.moments(slot)
        assert np.allclose(LoadMoment(station, axis)(c), expected, atol=1e-9 * np.abs(expected).max()), slot


def test_a_twist_is_the_transform_it_stands_for():
    """alpha1 … alpha5 turn about the x axis of the next joint's frame: the same columns."""
    c = context("comau-nj130", "pose")
    for link in range(1, 6):
        direct = Parameter("direct", "rad", 1e-3, "", transform_move(c.setup.chain.index(f"alpha{link}")))
        twist = Parameter("twist", "rad", 1e-3, "", twist_moves(link + 1, 0, ONE))
        rows = Model(c.setup, (direct, twist)).rows(c.samples)
        assert np.allclose(rows[..., 0], rows[..., 1], atol=1e-12)


def test_weights_are_those_of_newton_and_euler():
    """A kilogram more in one link changes the torques that hold the arm by the weight's φ."""
    c = context("kuka-kr6-r700", "position")
    robot = c.setup.robot
    model, frames = pin_model(robot)
    model.gravity.linear = c.setup.gravity_B
    theta = robot.theta(c.samples.q)
    data = model.createData()
    before = np.array([pin.rnea(model, data, t, np.zeros(6), np.zeros(6)) for t in theta])
    for link in (1, 2, 4):
        heavier, _ = pin_model(robot)
        heavier.gravity.linear = c.setup.gravity_B
        parent, T = frames[link + 1]
        heavier.appendBodyToJoint(parent, pin.Inertia(1.0, np.array(robot.masses[link].com), np.zeros((3, 3))), T)
        data = heavier.createData()
        more = np.array([pin.rnea(heavier, data, t, np.zeros(6), np.zeros(6)) for t in theta]) - before
        found = np.stack([WeightTorque(i, link)(c) for i in range(6)], axis=1)
        assert np.allclose(found[:, : link + 1], -more[:, : link + 1], atol=1e-9)
    assert np.allclose(PayloadTorque(2)(c), c.samples.payload * WeightTorque(2, 6)(c))
    alone = replace(c.setup, robot=replace(robot, masses=(None,) * 6), tool_mass=0.0)
    assert np.allclose(Context(alone, c.samples).load_torque[:, 2], PayloadTorque(2)(c), atol=1e-9)


def test_rates_are_what_a_moving_arm_shows():
    """Along a course with constant joint speeds, lengths and points change as −φ says."""
    for kind in ("length", "position"):
        c = context(kind=kind)
        h = 1e-6
        there, back = (replace(c.samples, q=c.samples.q + k * h * c.samples.speed, length=None) for k in (1, -1))
        a, b = Context(c.setup, there), Context(c.setup, back)
        if kind == "length":
            rate = (a.bar.length - b.bar.length) / (2 * h)
            assert np.allclose(LengthLag()(c), -rate, atol=1e-7)
        rate = (a.motion.x - b.motion.x).T / (2 * h)
        assert np.allclose(np.stack([PointLag(k)(c) for k in range(3)], axis=1), -rate, atol=1e-7)


def test_plain_formulas():
    c = context()
    s, q = c.samples, c.samples.q
    down = c.setup.gravity_B / np.linalg.norm(c.setup.gravity_B)
    e = c.motion.x.T - c.setup.p_BX[s.place]
    e = e / np.linalg.norm(e, axis=1)[:, None]
    R_BF = np.moveaxis(c.motion.R, 2, 0)
    theta_speed = s.speed @ c.setup.robot.coupling_matrix.T
    horizontal = np.linalg.norm(e - np.outer(e @ down, down), axis=1)
    both = {
        JointWave("sin", 2, 12.5): np.sin(12.5 * q[:, 2]),
        JointWave("cos", 2, 12.5): np.cos(12.5 * q[:, 2]),
        BoundedWave("sin", 2, 12.5, -0.2, 0.3): np.sin(12.5 * np.maximum(np.minimum(q[:, 2], 0.3), -0.2)),
        JointAngle(1, 0.3): q[:, 1] - 0.3,
        SpeedSign(3): np.where(s.speed[:, 3] > 0, 0.5, -0.5),
        ApproachDirection(3): s.direction[:, 3] / 2,
        SpeedLag(4): -theta_speed[:, 4],
        SettlingError(0): (s.q_cmd - s.q_read)[:, 0] * c.setup.robot.coupling_matrix[0, 0],
        DriveTorque(1): -s.torque[:, 1] * c.setup.robot.coupling_matrix[1, 1],
        TorqueSign(1): np.sign(c.load_torque[:, 1]) / 2,
        TemperatureRise(21.0): s.temperature - 21.0,
        ElapsedTime(5.0): s.t - 5.0,
        WarmUp(5.0, 600.0): 1 - np.exp(-(s.t - 5.0) / 600.0),
        Less(0.25, WarmUp(5.0, 600.0)): 0.75 - np.exp(-(s.t - 5.0) / 600.0),
        TimeWave(5.0, 900.0, 2): np.sqrt(2) * np.cos(2 * np.pi * (s.t - 5.0) / 900.0),
        BarShape(0.4, 0.1, 2, 1, 0, 1): np.sqrt(5) * (1.5 * ((s.length - 0.4) / 0.1) ** 2 - 0.5) * e[:, 0] * e[:, 2],
        HangingShape(0.4, 0.1, 1, 1): np.sqrt(3) * (s.length - 0.4) / 0.1 * horizontal**2 * -(e @ down),
        PlaceInSession(1, 2): 1.0 * ((s.place == 1) & (s.session == 2)),
        LengthPower(0.4, 0.1, 3): ((s.length - 0.4) / 0.1) ** 3,
        LengthGrowth(20.0): (s.temperature - 20.0) * s.length,
        BallOffset("fixture", 1): e[:, 1],
        BallOffset("tool", 2): np.einsum("nij,ni->nj", R_BF, e)[:, 2],
        BarSag(0.4): (s.length / 0.4) ** 3 * horizontal**2,
    }
    for phi, expected in both.items():
        assert np.allclose(phi(c), expected, atol=1e-12), phi


def test_plain_formulas_of_a_tracker():
    c = context(kind="position")
    ray = c.motion.x.T - c.setup.p_BG[c.samples.place]
    up = -c.setup.gravity_B / np.linalg.norm(c.setup.gravity_B)
    assert np.allclose(GaugeRay(1)(c), ray[:, 1])
    assert np.allclose(RayGrowth(2, 20.0)(c), (c.samples.temperature - 20.0) * ray[:, 2])
    assert np.allclose(BeamRefraction(0)(c), up[0] * np.linalg.norm(ray, axis=1) ** 2)
    R_BF, at = np.moveaxis(c.stations.R[-1], 2, 0), c.stations.p[-1].T
    moment = np.einsum("nij,ni->nj", R_BF, np.cross(c.motion.x.T - at, c.setup.gravity_B))
    assert np.allclose(TipMoment(1)(c), moment[:, 1])


def test_hysteresis_follows_a_friction_element_step_by_step():
    """A slider on a spring, pulled along a random path in many small steps."""
    rng = np.random.default_rng(9)
    c = context(n=400)
    q, width, state = np.cumsum(rng.normal(0, 0.05, 400)), 0.2, 0.0
    expected = []
    for k in range(400):
        for part in np.linspace(q[max(k - 1, 0)], q[k], 51)[1:] - np.linspace(q[max(k - 1, 0)], q[k], 51)[:-1]:
            state = min(0.5, max(-0.5, state + part / width))
        expected.append(state)
    turned = np.array([np.concatenate([np.repeat(q[0], 400 - k - 1), q[: k + 1]]) for k in range(400)])
    angles = np.repeat(q[:, None], 6, axis=1)
    s = replace(c.samples, q=angles, reversals=np.repeat(turned[:, None], 6, axis=1))
    assert np.allclose(Hysteresis(2, width)(Context(c.setup, s)), expected, atol=1e-12)


def test_what_moves_in_time_is_nought_on_average_over_the_run():
    """By quadrature: what is released beside it is the arm as it was on average, and not at the start."""
    time = np.linspace(40.0, 2_440.0, 24_001)
    c = context(n=len(time))
    c = Context(c.setup, replace(c.samples, t=time))
    run = Excitation.of(c.setup, c.samples)
    slow = [Less(WarmUp(40.0, 300.0).mean(2_400.0), WarmUp(40.0, 300.0)), ElapsedTime(run.middle_time)]
    slow += [TimeWave(run.start, run.duration, k) for k in (1, 2, 3)]
    for phi in slow:
        values = phi(c)
        assert abs(np.trapezoid(values, time) / np.trapezoid(np.abs(values), time)) < 1e-4, phi
    assert np.trapezoid(slow[-1](c) ** 2, time) / 2_400.0 == pytest.approx(1.0, rel=1e-3)
