"""One forward pass that says where tool and bar stand and how fast each joint moves them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.cell import Cell
from planner.chain import Chain
from planner.gauge import bar_state
from planner.units import Array
from planner.workspace import axis_reach, swing, wrap


@dataclass(frozen=True)
class Pose:
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
class Kinematics:
    """Forward pass of a cell with one fixture; agrees with :class:`planner.workspace.Workspace`."""

    cell: Cell
    fixture: int = 0

    def at(self, q: Array) -> Pose:
        """Return tool and bar at controller angles q (n, N) [rad]."""
        motion = self._chain.forward(self.cell.robot.theta(q))
        J = np.moveaxis(motion.point_screws()[self._moving], (0, 1, 2), (2, 1, 0))
        W = np.moveaxis(motion.u[self._moving], (0, 1, 2), (2, 1, 0))
        bar = bar_state(motion.x.T, self.cell.fixtures[self.fixture].p_BX)
        axis = np.einsum("ijn,j->ni", motion.R, self.cell.tool.axis_F)
        mark = np.einsum("ijn,j->ni", motion.R, _across(self.cell.tool.axis_F))
        spin = wrap(self._twist(bar.direction, axis, mark) - self._zero)
        return Pose(motion.x.T, J, W, bar.length, bar.direction, axis, spin)

    @cached_property
    def map_reach(self) -> Array:
        """Largest distance of the MAP from each joint's axis over all states, (N,) [m]."""
        return axis_reach(self._chain.transforms, self.cell.robot.n_joints)

    @cached_property
    def _chain(self) -> Chain:
        return self.cell.chain

    @cached_property
    def _moving(self) -> list[int]:
        joints = {t.joint: k for k, t in enumerate(self._chain.transforms) if t.joint is not None}
        return [joints[j] for j in range(self.cell.robot.n_joints)]

    @cached_property
    def _zero(self) -> float:
        """Twist at the state where the bar is attached; which lines are painted on the bar then cancels."""
        mount = self.cell.fixtures[self.fixture].mount
        q = (self.cell.home if mount is None else mount)[None]
        motion = self._chain.forward(self.cell.robot.theta(q))
        direction = bar_state(motion.x.T, self.cell.fixtures[self.fixture].p_BX).direction
        axis, mark = (motion.R[:, :, 0] @ v for v in (self.cell.tool.axis_F, _across(self.cell.tool.axis_F)))
        return float(self._twist(direction, axis[None], mark[None])[0])

    def _twist(self, direction: Array, axis: Array, mark: Array) -> Array:
        """Angle about the bar between a line carried from the fixture's axis and one from the tool's, (n,) [rad]."""
        fixed = self.cell.fixtures[self.fixture].axis_B
        at_fixture = swing(_across(fixed)[None], fixed[None], direction)
        at_map = swing(mark, axis, -direction)
        sine = np.einsum("ni,ni->n", np.cross(at_fixture, at_map), direction)
        return np.asarray(np.arctan2(sine, np.einsum("ni,ni->n", at_fixture, at_map)))


def _across(axis: Array) -> Array:
    """Return a unit vector across the unit vector ``axis`` (3,)."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    out = np.cross(axis, helper)
    return np.asarray(out / np.linalg.norm(out))
