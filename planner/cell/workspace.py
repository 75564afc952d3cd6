"""How far inside the gauge's workspace a state lies: limits, bar length, ball-joint cones and cable, in one table.

Each column is a margin that is positive inside, with a bound on how fast it can change along a motion; the
candidates' filters, the support-pose planner and the continuous check of the path all use this one table.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from planner.cell.cell import Cell, Fixture
from planner.cell.gauge import FilterStage, PointTravel
from planner.common.units import Array, read_only
from planner.kinematics.bar_geometry import bar_state
from planner.kinematics.chain import Transform
from planner.runs.run import FIRST_MOUNTING, Mounting

STAGES: tuple[FilterStage, ...] = ("joint_limits", "workspace", "cones", "cable")
SAFETY_MARGIN = 2e-3  # [m or rad] that a measuring pose keeps from every limit, so that a path can reach it
SIDE = np.array([1.0, 0.0, 0.0])


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

    def margins(self, q: Array) -> Array:
        """Margins at controller angles q (n, N) [rad], (n, columns) [rad or m]; negative outside."""
        return np.column_stack([self.stage(stage, q) for stage in STAGES])

    def inside(self, q: Array, margin: float) -> np.ndarray:
        """Tell which controller angles (n, N) [rad] keep every margin above ``margin`` [m or rad], (n,) bool."""
        left = np.arange(len(q))
        for stage in STAGES:  # each looks only at what those before it left
            left = left[(self.stage(stage, q[left]) > margin).all(axis=1)]
        out = np.zeros(len(q), dtype=bool)
        out[left] = True
        return out

    def stage(self, stage: FilterStage, q: Array) -> Array:
        """Margins of one stage, (n, its columns) [rad or m]: filters run one after the other pay only for their own."""
        cell, robot, empty = self.cell, self.cell.robot, np.empty((len(q), 0))
        if stage == "joint_limits":
            return np.asarray(np.minimum(q - robot.q_lower, robot.q_upper - q))
        if stage == "cable":
            sums = [limit - np.abs(q[:, axes] - cell.home[list(axes)]).sum(axis=1) for axes, limit in cell.cable.sums]
            spun = self.bar and cell.cable.tool_about_bar is not None
            spin = [cell.cable.tool_about_bar - np.abs(self.spin(q))] if spun else []
            return np.column_stack([empty, *sums, *spin])
        if not self.bar:
            return empty
        return cell.gauge.margins(stage, self.fixture, cell.map_position(q), cell.map_axis(q))

    def spin(self, q: Array) -> Array:
        """Turn of the tool about the bar, (n,) [rad] in (−π, π], zero at the mount pose (at home while there is none).

        A line painted on the bar is carried without twist from the fixture's axis to the bar's direction, another
        from the tool's axis to the bar; the angle between them is what a cable along the bar is twisted by.
        """
        return wrap_angle(self._raw_spin(q) - self._zero_spin)

    def rates(self, dq: Array) -> Array:
        """Largest change of each margin while q moves by ``dq`` (m, N) [rad] on a straight leg, (m, columns)."""
        cell, step = self.cell, np.abs(dq)
        sums = [step[:, axes].sum(axis=1) for axes, _ in cell.cable.sums]
        if not self.bar:
            return np.column_stack([step, *sums])
        theta = np.abs(dq @ cell.robot.sense_matrix.T)
        move, turn = theta @ self.map_reach, theta.sum(axis=1)
        with np.errstate(divide="ignore"):
            swing = move / cell.gauge.length_min
        own = cell.gauge.margin_changes(PointTravel(move, move, swing, turn))
        spin = []
        if cell.cable.tool_about_bar is not None:
            # parallel transport about an axis tilted by up to c turns at tan(c/2) times the rate of the tilt
            at_fixture, at_map = np.tan(cell.gauge.cone_fixture / 2), np.tan(cell.gauge.cone_map / 2)
            spin = [turn + swing * at_fixture + (swing + turn) * at_map]
        return np.column_stack([step, *own, *sums, *spin])

    @cached_property
    def map_reach(self) -> Array:
        """Largest distance of the MAP from each joint's axis over all states, (N,) [m]."""
        return axis_reach(self.cell.chain.transforms, self.cell.robot.n_joints)

    @cached_property
    def _zero_spin(self) -> float:
        mount = self.cell.mount(self.mounting)
        return float(self._raw_spin((self.cell.home if mount is None else mount)[None])[0])

    def _raw_spin(self, q: Array) -> Array:
        fixture = self.fixture
        chain, theta = self.cell.chain, self.cell.robot.theta(q)
        d = bar_state(self.cell.map_position(q), fixture.p_BX).direction
        axis = self.cell.map_axis(q)
        mark_F = _perpendicular(self.cell.tool.axis_F[None])[0]
        at_fixture = parallel_transport(_perpendicular(fixture.axis_B[None]), fixture.axis_B[None], d)
        at_map = parallel_transport(chain.carry(theta, mark_F, point=False), axis, -d)
        sine = np.einsum("ni,ni->n", np.cross(at_fixture, at_map), d)
        return np.asarray(np.arctan2(sine, np.einsum("ni,ni->n", at_fixture, at_map)))


def wrap_angle(angle: Array) -> Array:
    """Return the angle in (−π, π]."""
    return np.asarray(-((-angle + np.pi) % (2 * np.pi) - np.pi))


def parallel_transport(v: Array, a: Array, b: Array) -> Array:
    """Carry vectors v (n, 3) by the smallest rotation that takes the unit vectors a to b, (n, 3)."""
    w = np.cross(a, b)
    c = np.maximum(1.0 + np.einsum("ni,ni->n", *np.broadcast_arrays(a, b)), 1e-12)[:, None]
    u = np.cross(w, v)
    return np.asarray(v + u + np.cross(w, u) / c)


def axis_reach(transforms: Sequence[Transform], n_joints: int, tail: float = 0.0) -> Array:
    """Bound how far from each joint's axis anything carried behind ``transforms`` can be, in any state, (N,) [m].

    Args:
        transforms: elementary transforms from the base to the frame that carries it.
        n_joints: number of joints N; joints not among the transforms get 0.
        tail: largest distance of the carried points from that frame's origin [m].
    """
    return _axis_reach(tuple(transforms), n_joints, tail)


@lru_cache(maxsize=8192)  # asked for every pair of bodies in every set of constraints
def _axis_reach(transforms: tuple[Transform, ...], n_joints: int, tail: float) -> Array:
    out, behind, box = np.zeros(n_joints), tail, np.zeros(3)
    for t in reversed(transforms):
        if t.kind == "translation":
            box[t.axis] += abs(t.nominal)
        elif t.joint is not None:
            # what lies along the axis does not move when it turns, but counts for the joints before
            out[t.joint] = behind + np.linalg.norm(np.delete(box, t.axis))
            behind, box = behind + float(np.linalg.norm(box)), np.zeros(3)
        elif np.isclose(np.cos(t.nominal), 0.0):  # a right angle only renames the other two axes
            b, c = (t.axis + 1) % 3, (t.axis + 2) % 3
            box[[b, c]] = box[[c, b]]
        elif not np.isclose(np.sin(t.nominal), 0.0):
            behind, box = behind + float(np.linalg.norm(box)), np.zeros(3)
    return read_only(out)


def _perpendicular(axis: Array) -> Array:
    """A unit vector across each of the unit vectors (n, 3)."""
    helper = np.where(np.abs(axis @ SIDE)[:, None] < 0.9, SIDE[None], [[0.0, 1.0, 0.0]])
    out = np.cross(axis, helper)
    return np.asarray(out / np.linalg.norm(out, axis=1)[:, None])
