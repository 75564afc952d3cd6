"""What a person sets up with the robot itself: a cup is adjusted to the ball of the tool where the robot takes it.

A drawn robot is one that its cell describes: it errs by no more than the cell says of a robot before calibration.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from planner.cell.cell import Cell
from planner.cell.parts import Fixture
from planner.cell.placement import Targets
from planner.common.units import MM, Array
from planner.gauges.frame_gauge import ToolPosition
from planner.kinematics.inverse_kinematics import POINT_TOLERANCE, solve_point_ik, solve_pose_ik, tool_pose
from planner.model.model import Model
from planner.runs.run import Mounting, Samples
from planner.simulation.assumptions import CUP_SIGMA

APART = ("fixture_", "zero")  # names of errors that are the set-up's, not the robot's or the tool's


def set_up_sizes(cell: Cell, model: Model) -> Array:
    """Return the one-sigma sizes (P,) of errors by which robot, tool and gauge of a cell are drawn.

    They are the prior sigmas, but where a fixture is set up by the robot, only the care of the hand that adjusts it is
    left, beside what the robot errs there (:func:`place_fixtures_by_robot`). The zero of a bar is set on the same ball;
    one that is known is set as well as the bar reads.
    """
    sizes = model.prior.copy()
    by_robot = [f.name for f, _ in _poses_at_fixtures(cell)]
    adjusted = {f"fixture_{name}_{axis}" for name in by_robot for axis in "xyz"}
    zero = CUP_SIGMA if by_robot and len(by_robot) == len(cell.fixtures) else np.inf
    zero = zero if cell.gauge.zero_free else cell.gauge.noise
    for k, name in enumerate(model.names):
        if name in adjusted:
            sizes[k] = CUP_SIGMA
        elif name.startswith("zero"):
            sizes[k] = min(zero, sizes[k])
    return sizes


def place_fixtures_by_robot(cell: Cell, model: Model, errors: Array) -> Array:
    """Return errors (P,) with every fixture that the robot sets up where its tool point truly comes.

    The tool point is told to go to the fixture's place by the nominal robot, as in the EDBB paper (section 3.1: "the
    robot is moved to this position with its MAP and the zero point is adjusted with the help of a calibration ball"):
    whatever the robot errs there is in the fixture's place. What ``errors`` already says of its place is added.
    """
    own = [k for k, p in enumerate(model.parameters) if not p.name.startswith(APART)]
    tool_point = replace(model.subset(own), setup=replace(model.setup, gauge=ToolPosition(noise=0.0)))
    at_base = Targets(position=np.zeros((1, 3)))
    out = errors.copy()
    for fixture, q in _poses_at_fixtures(cell):
        (p_BM,) = -tool_point.residual(Samples.at(q, Mounting(0)), at_base, errors[own])
        for axis, off in zip("xyz", p_BM - fixture.p_BX, strict=True):
            out[model.names.index(f"fixture_{fixture.name}_{axis}")] += off
    return out


def _poses_at_fixtures(cell: Cell) -> Iterator[tuple[Fixture, Array]]:
    """Yield every fixture that the robot sets up, with the pose (1, N) [rad] for that."""
    for fixture in cell.fixtures:
        if fixture.set_up == "robot" and (q := solve_fixture_pose(cell, fixture.p_BX)) is not None:
            yield fixture, q


def solve_fixture_pose(cell: Cell, p_BX: Array) -> Array | None:
    """Return a pose (1, N) [rad] with the tool point at p_BX (3,) [m], the tool turned as at home or as little off it.

    ``None`` where the robot does not reach it so within its limits.
    """
    tilts = (0.0, 20.0, -20.0, 40.0, -40.0)  # [deg] of it about the base's x: a ball joint takes them all
    turns = (0.0, 90.0, -90.0, 180.0)  # [deg] of the tool about the base's z, from as it is turned at home
    robot = cell.robot
    _, R, _ = tool_pose(cell.chain, robot, cell.home[None])
    turned = Rotation.from_euler("xz", [(tilt, turn) for turn in turns for tilt in tilts], degrees=True).as_matrix() @ R
    for some in (turned[:1], turned[1:]):  # mostly the first one is reached
        start, point = np.tile(cell.home, (len(some), 1)), np.tile(p_BX, (len(some), 1))
        q, good = solve_pose_ik(cell.chain, robot, start, point, some, 60)  # rounds
        reached = np.flatnonzero(good & ((q >= robot.q_lower) & (q <= robot.q_upper)).all(axis=1))
        if len(reached):
            return np.asarray(q[reached[:1]])
    return None


@dataclass(frozen=True)
class UncalibratedBound:
    """What the gauge says of a robot before calibration, and what that makes of drawn errors.

    Attributes:
        most: by which the tool point errs at most, for the sake of the gauge [m].
        factor: on every drawn error of the robot, at most 1: all keep their proportions.
    """

    most: float
    factor: float

    @property
    def text(self) -> str:
        """What was done to the drawn errors."""
        return (
            f"drawn errors of the robot times {self.factor:.4f}: its tool point is off by "
            f"{self.most / MM:g} mm at most at the balls (gauge.head.uncalibrated_mm)"
        )


def bound_uncalibrated_errors(cell: Cell, model: Model, errors: Array) -> UncalibratedBound | None:
    """Return how errors (P,) of a robot are made as small as its cell says; ``None`` where it says nothing of that.

    A head of indicators reads near the centre of a ball alone, so its cell states how far an uncalibrated robot errs at
    most (``uncalibrated_mm``), and its plan counts on that. The tool point's error, by geometry and
    compliance together, is looked at in postures from all over the joints' limits that bring it to the balls.
    """
    head = cell.gauge.head
    if head is None:
        return None
    own = [k for k, p in enumerate(model.parameters) if p.group != "gauge"]
    rows = model.subset(own).rows(Samples.at(states_at_balls(cell)))
    largest = float(np.linalg.norm(rows @ errors[own], axis=1).max(initial=0.0))
    return UncalibratedBound(head.uncalibrated, min(1.0, head.uncalibrated / largest) if largest else 1.0)


def states_at_balls(cell: Cell) -> Array:
    """Return joint angles (n, N) [rad], within their limits, that bring the tool point to the balls of a cell."""
    robot = cell.robot
    # 1000 are led to each ball; about four in ten come there within their limits
    some = np.random.default_rng(0).uniform(robot.q_lower, robot.q_upper, (1000, robot.n_joints))
    led = [solve_point_ik(cell.chain, robot, some, p) for p in cell.p_BS]
    q, off = (np.concatenate(parts) for parts in zip(*led, strict=True))
    within = ((q >= robot.q_lower) & (q <= robot.q_upper)).all(axis=1)
    return np.asarray(q[within & (off < POINT_TOLERANCE)])
