"""Rigs of every kind of gauge, drawn at random, and samples for them."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from planner.cell.cell import MeasurementSetup, setup_of
from planner.cell.placement import Targets
from planner.cell.reading import load_cell
from planner.effects.compliance import compliance_parameters
from planner.gauges.ball_socket import BallSocket
from planner.gauges.bar import DoubleBallBar
from planner.gauges.tracker import PoseTracker, Tracker
from planner.kinematics.robot import Robot
from planner.kinematics.robot_reader import load_robot
from planner.model.model import Model
from planner.runs.run import Readings, Samples

KINDS = ("length", "position", "pose", "sockets")
GAUGES = {
    "length": DoubleBallBar(noise=1e-6),
    "position": Tracker(noise=1e-6),
    "pose": PoseTracker(noise=1e-6),
    "sockets": BallSocket(noise=1e-6),
}
PLACES, POINTS, SOCKETS = 3, 2, 4
ROBOTS = ("comau-nj130", "kuka-kr6-r700", "ur10", "abb-irb120", "abb-irb6700")


def setup(robot_name: str, kind: str, rng: np.random.Generator) -> MeasurementSetup:
    """A setup with several places and points, its base and everything on it anyhow in space."""
    robot = load_robot(robot_name)
    turned = Rotation.random(PLACES, random_state=rng).as_matrix()
    down = Rotation.random(random_state=rng).as_matrix()[2]
    base = setup_of(load_cell("ur10/edbb"))
    return replace(
        base,
        robot=robot,
        gauge=GAUGES[kind],
        p_BX=rng.normal((0.0, 0.0, 3.0), 1.0, (PLACES, 3)),
        R_BG=turned if kind != "length" else np.broadcast_to(np.eye(3), (PLACES, 3, 3)),
        p_BG=rng.normal(0.0, 1.0, (PLACES, 3)) if kind != "length" else np.zeros((PLACES, 3)),
        p_FM=rng.normal(0.0, 0.1, (POINTS, 3)),
        R_FM=Rotation.random(POINTS, random_state=rng).as_matrix(),
        p_GS=rng.normal(0.0, 0.2, (SOCKETS, 3)),
        ball_names=tuple(map(str, range(1, SOCKETS + 1))),
        place_names=("A", "B", "C"),
        point_names=("left", "right"),
        place_prior=np.full(PLACES, 5e-3),
        tool_prior=1e-3,
        turn_prior=0.02,
        gravity_B=9.80665 * down,
        tool_mass=2.3,
        com_F=rng.normal(0.0, 0.05, 3),
        zero=1.7e-3,
    )


def samples(robot: Robot, n: int, rng: np.random.Generator, force: bool = True) -> Samples:
    """Random samples over all joint angles, places and points, with payload and, if wished, the bar's pull."""
    q = rng.uniform(robot.q_lower, robot.q_upper, (n, robot.n_joints))
    return Samples(
        q,
        rng.integers(0, PLACES, n),
        point=rng.integers(0, POINTS, n),
        payload=rng.uniform(0.0, 8.0, n),
        force=rng.uniform(50.0, 600.0, n) if force else None,
    )


def whole_model(r: MeasurementSetup) -> Model:
    """Every parameter there is: gauge, geometry, compliance."""
    return Model.of(r, frozenset({"fixture", "tool", "zero"})).plus(compliance_parameters(r))


def readings(r: MeasurementSetup, kind: str, s: Samples, rng: np.random.Generator) -> Readings:
    """Readings near what the nominal robot gives, off by millimetres and milliradians."""
    n = len(s)
    motion = r.chain.forward(r.robot.theta(s.q), r.offsets(s))
    x = motion.x.T + rng.normal(0.0, 1e-3, (n, 3))
    if kind == "length":
        return Readings(length=np.linalg.norm(x - r.p_BX[s.place], axis=1) + r.zero)
    p_GM = np.einsum("nji,nj->ni", r.R_BG[s.place], x - r.p_BG[s.place])
    if kind == "position":
        return Readings(position=p_GM)
    if kind == "sockets":
        ball = rng.integers(0, SOCKETS, n)
        return Readings(ball=ball, offset=p_GM - r.p_GS[ball])
    R_BM = np.moveaxis(motion.R, 2, 0) @ r.R_FM[s.point]
    off = Rotation.from_rotvec(rng.normal(0.0, 1e-3, (n, 3))).as_matrix()
    return Readings(position=p_GM, rotation=np.swapaxes(r.R_BG[s.place], 1, 2) @ off @ R_BM)


def targets(r: MeasurementSetup, kind: str, s: Samples, rng: np.random.Generator) -> Targets:
    """The same in the base frame."""
    return r.targets(s, readings(r, kind, s, rng))
