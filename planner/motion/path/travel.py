"""Where tool and bar are at a state, and how far they can get while the joints move within a small neighbourhood of
it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.cell.cell import Cell, Fixture
from planner.cell.gauge_types import PointTravel
from planner.cell.workspace import axis_reach, bar_twist, perpendicular, wrap_angle
from planner.common.units import Array
from planner.kinematics.bar_geometry import bar_state
from planner.kinematics.chain import Chain
from planner.runs.run import FIRST_MOUNTING, Mounting


@dataclass(frozen=True)
class ToolState:
    """Tool and bar at n states, in the base frame.

    Attributes:
        x: measurement application point, (n, 3) [m].
        J: its velocity per joint angle of the kinematic rows, (n, 3, N) [m].
        W: angular velocity of the tool per joint angle, (n, 3, N).
        length: of the bar, (n,) [m].
        direction: of the bar from fixture to MAP, (n, 3).
        axis: of the MAP's ball joint, (n, 3).
        spin: turn of the tool about the bar from its zero, (n,) [rad].
    """

    x: Array
    J: Array
    W: Array
    length: Array
    direction: Array
    axis: Array
    spin: Array


@dataclass(frozen=True)
class ToolKinematics:
    """Forward pass of a cell with the gauge held in one way; agrees with :class:`planner.cell.workspace.Workspace`."""

    cell: Cell
    mounting: Mounting = FIRST_MOUNTING

    @property
    def _fixture(self) -> Fixture:
        return self.cell.fixtures[self.mounting.fixture]

    def at(self, q: Array) -> ToolState:
        """Return tool and bar at controller angles q (n, N) [rad]."""
        motion = self._chain.forward(self.cell.robot.theta(q))
        J = np.moveaxis(motion.point_screws(self._chain.joint_places), (0, 1, 2), (2, 1, 0))
        W = np.moveaxis(motion.u[self._chain.joint_places], (0, 1, 2), (2, 1, 0))
        bar = bar_state(motion.x.T, self._fixture.p_BX)
        axis = np.einsum("ijn,j->ni", motion.R, self.cell.tool.axis_F)
        mark = np.einsum("ijn,j->ni", motion.R, perpendicular(self.cell.tool.axis_F))
        spin = wrap_angle(bar_twist(self._fixture.axis_B, bar.direction, axis, mark) - self._zero)
        return ToolState(motion.x.T, J, W, bar.length, bar.direction, axis, spin)

    @cached_property
    def map_reach(self) -> Array:
        """Largest distance of the MAP from each joint's axis over all states, (N,) [m]."""
        return axis_reach(self._chain.transforms, self.cell.robot.n_joints)

    @cached_property
    def _chain(self) -> Chain:
        return self.cell.chain

    @cached_property
    def _zero(self) -> float:
        """Twist at the state where the bar is attached; which lines are painted on the bar then cancels."""
        mount = self.cell.mount(self.mounting)
        q = (self.cell.home if mount is None else mount)[None]
        motion = self._chain.forward(self.cell.robot.theta(q))
        direction = bar_state(motion.x.T, self._fixture.p_BX).direction
        axis, mark = (motion.R[:, :, 0] @ v for v in (self.cell.tool.axis_F, perpendicular(self.cell.tool.axis_F)))
        return float(bar_twist(self._fixture.axis_B, direction, axis[None], mark[None])[0])


FAR = np.inf


@dataclass(frozen=True)
class Travel(PointTravel):
    """Bounds over n neighbourhoods.

    Attributes:
        step: largest |Δθ| of each joint, (n, N) [rad].
    """

    step: Array


def bound_travel(pose: ToolState, spokes: Array, reach: Array) -> Travel:
    """Bound the travel of tool and bar over neighbourhoods.

    Args:
        pose: tool and bar at the n centres.
        spokes: Δθ of each spoke, (n, M, N) [rad].
        reach: largest distance of the MAP from each axis, (N,) [m].
    """
    step = np.abs(spokes).max(axis=1)
    velocity = np.einsum("nij,nmj->nmi", pose.J, spokes)
    bend = curvature(step, reach)
    speed = np.linalg.norm(velocity, axis=2).max(axis=1)
    move = speed + bend / 2
    along = np.abs(np.einsum("nmi,ni->nm", velocity, pose.direction)).max(axis=1)
    left = pose.length - move  # shortest length in the neighbourhood
    safe = np.maximum(left, 1e-9)
    stretch = np.minimum(move, along + ((speed + bend) ** 2 / safe + bend) / 2)
    swing = np.where(left > 0, move / safe, FAR)
    spinning = np.linalg.norm(np.einsum("nij,nmj->nmi", pose.W, spokes), axis=2).max(axis=1)
    earlier = np.cumsum(step, axis=1) - step
    turn = spinning + np.einsum("nj,nj->n", step, earlier) / 2
    return Travel(move, stretch, swing, turn, step)


def curvature(step: Array, reach: Array) -> Array:
    """Return Σ_ij step_i step_j reach_max(i,j), (n,) [m], for steps (n, N) [rad] and reaches (N,) [m]."""
    joint = np.arange(len(reach))
    return np.asarray(np.einsum("ni,nj,ij->n", step, step, reach[np.maximum.outer(joint, joint)], optimize=True))
