"""What a person sets up with the robot itself: a cup is adjusted to the ball of the tool where the robot takes it."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from planner.cell.cell import Cell
from planner.cell.parts import Fixture
from planner.cell.placement import Targets
from planner.common.units import Array
from planner.gauges.frame_gauge import ToolPosition
from planner.kinematics.inverse_kinematics import solve_pose_ik, tool_pose
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
