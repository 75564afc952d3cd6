"""How far inside the gauge's workspace a state lies: limits, bar length, ball-joint cones and cable, in one table.

Each column is a margin that is positive inside. The candidates' filters, the support-pose planner and the continuous
check of the path all use this one table.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np

from planner.cell.cell import Cell
from planner.cell.gauge_types import FilterStage
from planner.cell.parts import Fixture
from planner.common.units import Array, read_only
from planner.kinematics.chain import Transform
from planner.kinematics.geometry import bar_state
from planner.runs.run import FIRST_MOUNTING, Mounting

STAGES: tuple[FilterStage, ...] = ("joint_limits", "workspace", "cones", "cable")
SAFETY_MARGIN = 2e-3  # [m or rad] that a measuring pose keeps from every limit, so that a path can reach it


class ToolPose(Protocol):
    """Where the tool is at n states: MAP x (n, 3) [m], axis of its ball joint (n, 3), turn about the bar (n,) [rad]."""

    @property
    def x(self) -> Array:
        """The measurement application point."""

    @property
    def axis(self) -> Array:
        """The axis of its ball joint."""

    @property
    def spin(self) -> Array:
        """The turn of the tool about the bar from its zero."""


@dataclass(frozen=True)
class Workspace:
    """Constraints of a cell with the gauge held in one way; ``bar`` says whether the bar is attached."""

    cell: Cell
    mounting: Mounting = FIRST_MOUNTING
    bar: bool = True

    def __post_init__(self) -> None:
        """Take the tool point that the bar hangs from."""
        object.__setattr__(self, "cell", self.cell.at(self.mounting))

    @property
    def fixture(self) -> Fixture:
        """The fixture that holds the gauge."""
        return self.cell.fixtures[self.mounting.fixture]

    @cached_property
    def columns(self) -> tuple[tuple[FilterStage, str], ...]:
        """Stage and name of each margin."""
        limits = [("joint_limits", f"limit of joint {i + 1}") for i in range(self.cell.robot.n_joints)]
        sums = [("cable", "twist of axes " + " + ".join(str(a + 1) for a in axes)) for axes, _ in self.cell.cable.sums]
        if not self.bar:
            return (*limits, *sums)
        spin = [] if self.cell.cable.tool_about_bar is None else [("cable", "twist of the tool about the bar")]
        return (*limits, *self.cell.gauge.margin_columns, *sums, *spin)

    def margins(self, q: Array, pose: ToolPose | None = None) -> Array:
        """Margins at controller angles q (n, N) [rad], (n, columns) [rad or m]; negative outside.

        ``pose``: where the tool is there, if that is known already.
        """
        return np.column_stack([self.stage(stage, q, pose) for stage in STAGES])

    def keeps_margin(self, q: Array, margin: float) -> np.ndarray:
        """Tell which controller angles (n, N) [rad] keep every margin above ``margin`` [m or rad], (n,) bool."""
        out = np.zeros(len(q), dtype=bool)
        out[self.positions_within_margins(q, margin)[-1]] = True
        return out

    def positions_within_margins(self, q: Array, margin: float) -> list[np.ndarray]:
        """Positions of those of the angles q (n, N) [rad] that keep every margin so far, after each of the stages."""
        cell, left, out = self.cell, np.arange(len(q)), list[np.ndarray]()
        tool: tuple[Array, Array] | None = None
        for stage in STAGES:  # each looks only at what those before it left
            if self.bar and stage in ("workspace", "cones"):  # where the tool is serves both
                x, axis = tool or (cell.map_position(q[left]), cell.map_axis(q[left]))
                kept = (cell.gauge.margins(stage, self.fixture, x, axis) > margin).all(axis=1)
                tool = x[kept], axis[kept]
            else:
                kept = (self.stage(stage, q[left]) > margin).all(axis=1)
            left = left[kept]
            out.append(left)
        return out

    def stage(self, stage: FilterStage, q: Array, pose: ToolPose | None = None) -> Array:
        """Margins of one stage, (n, its columns) [rad or m]: filters run one after the other pay only for their own."""
        cell, robot, empty = self.cell, self.cell.robot, np.empty((len(q), 0))
        if stage == "joint_limits":
            return np.asarray(np.minimum(q - robot.q_lower, robot.q_upper - q))
        if stage == "cable":
            sums = [limit - np.abs(q[:, axes] - cell.home[list(axes)]).sum(axis=1) for axes, limit in cell.cable.sums]
            limit, turned = cell.cable.tool_about_bar, []
            if self.bar and limit is not None:
                turned = [limit - np.abs(self.spin(q) if pose is None else pose.spin)]
            return np.column_stack([empty, *sums, *turned])
        if not self.bar:
            return empty
        x, axis = (cell.map_position(q), cell.map_axis(q)) if pose is None else (pose.x, pose.axis)
        return cell.gauge.margins(stage, self.fixture, x, axis)

    def spin(self, q: Array) -> Array:
        """Turn of the tool about the bar, (n,) [rad] in (−π, π], zero at the mount pose (at home while there is none).

        A line painted on the bar is carried without twist from the fixture's axis to the bar's direction, another
        from the tool's axis to the bar. The angle between them is what a cable along the bar is twisted by.
        """
        return wrap_angle(self._raw_spin(q) - self.zero_spin)

    @cached_property
    def zero_spin(self) -> float:
        """Twist at the state where the bar is attached; which lines are painted on the bar then cancels."""
        mount = self.cell.mount(self.mounting)
        return float(self._raw_spin((self.cell.home if mount is None else mount)[None])[0])

    def _raw_spin(self, q: Array) -> Array:
        fixture = self.fixture
        chain, theta = self.cell.chain, self.cell.robot.theta(q)
        direction = bar_state(self.cell.map_position(q), fixture.p_BX).direction
        mark = chain.carry(theta, unit_across(self.cell.tool.axis_F), point=False)
        return bar_twist(fixture.axis_B, direction, self.cell.map_axis(q), mark)


def bar_twist(fixed_B: Array, direction: Array, axis: Array, mark: Array) -> Array:
    """Return the twist of the bar about itself, between its joint at the fixture and that at the tool, (n,) [rad].

    Args:
        fixed_B: axis of the fixture's ball joint (3,).
        direction: of the bar from fixture to MAP, (n, 3).
        axis: of the MAP's ball joint, (n, 3); mark (n, 3): a unit vector across it that the tool carries.
    """
    at_fixture = parallel_transport(unit_across(fixed_B)[None], fixed_B[None], direction)
    at_map = parallel_transport(mark, axis, -direction)
    sine = triple_product(at_fixture, at_map, direction)
    return np.asarray(np.arctan2(sine, np.einsum("ni,ni->n", at_fixture, at_map)))


def triple_product(a: Array, b: Array, c: Array) -> Array:
    """Return (a × b) · c of vectors (n, 3), (n,); numpy's cross product takes several times as long."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = a.T, b.T, c.T
    return np.asarray((ay * bz - az * by) * cx + (az * bx - ax * bz) * cy + (ax * by - ay * bx) * cz)


def wrap_angle(angle: Array) -> Array:
    """Return the angle in (−π, π]."""
    return np.asarray(-((-angle + np.pi) % (2 * np.pi) - np.pi))


def parallel_transport(v: Array, a: Array, b: Array) -> Array:
    """Carry vectors v (n, 3) by the smallest rotation that takes the unit vectors a to b, (n, 3)."""
    c = np.maximum(1.0 + np.einsum("ni,ni->n", *np.broadcast_arrays(a, b)), 1e-12)[:, None]
    halfway = a + b  # the rotation is two reflections, in the plane across a and in that across what lies between
    share = np.einsum("ni,ni->n", *np.broadcast_arrays(halfway, v))[:, None] / c
    return np.asarray(v - share * halfway + 2 * np.einsum("ni,ni->n", *np.broadcast_arrays(a, v))[:, None] * b)


def axis_reach(transforms: Sequence[Transform], n_joints: int, tail: float = 0.0) -> Array:
    """Bound how far from each joint's axis anything carried behind ``transforms`` can be, in any state, (N,) [m].

    It is the speed of these points for a unit of the joint's speed, and so it is 1 [m/m] of a joint that slides. The
    second derivative by two joints is no larger than the bound of the later one: a turn carries the direction of a
    slide behind it with a unit of speed, and a slide changes nothing of a turn behind it.

    Args:
        transforms: elementary transforms from the base to the frame that carries it.
        n_joints: number of joints N; joints not among the transforms get 0.
        tail: largest distance of the carried points from that frame's origin [m].
    """
    return _reaches(tuple(transforms), n_joints, tail)[0]


def chain_reach(transforms: Sequence[Transform]) -> float:
    """Bound the distance of the two ends of a chain of elementary transforms, in any state [m]."""
    joints = [t.joint + 1 for t in transforms if t.joint is not None]
    return _reaches(tuple(transforms), max(joints, default=0), 0.0)[1]


@lru_cache(maxsize=8192)  # asked for every pair of bodies in every set of constraints
def _reaches(transforms: tuple[Transform, ...], n_joints: int, tail: float) -> tuple[Array, float]:
    """Return :func:`axis_reach`, and how far what is carried can be from where the chain begins [m]."""
    out, behind, box = np.zeros(n_joints), tail, np.zeros(3)
    for t in reversed(transforms):
        if t.kind == "translation":
            box[t.axis] += t.extent
            if t.joint is not None:
                out[t.joint] = 1.0  # a metre a metre, and as much across as an axis before it turns
        elif t.joint is not None:
            # what lies along the axis does not move when it turns, but counts for the joints before
            out[t.joint] = behind + np.linalg.norm(np.delete(box, t.axis))
            behind, box = behind + float(np.linalg.norm(box)), np.zeros(3)
        elif np.isclose(np.cos(t.nominal), 0.0):  # a right angle only renames the other two axes
            b, c = (t.axis + 1) % 3, (t.axis + 2) % 3
            box[[b, c]] = box[[c, b]]
        elif not np.isclose(np.sin(t.nominal), 0.0):
            behind, box = behind + float(np.linalg.norm(box)), np.zeros(3)
    return read_only(out), behind + float(np.linalg.norm(box))


def unit_across(axis: Array) -> Array:
    """Return a unit vector across the unit vector ``axis`` (3,)."""
    out = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    return np.asarray(out / np.linalg.norm(out))
