"""Correction of arms with fewer than six axes: the tool's place first, then its axis, then its turn.

Such an arm cannot bring its tool to every pose near one that it reaches: an SO-101 has four axes that move its tool in
one plane, so that a skewed calibrated arm tilts it out of that plane and no joint takes that back. What is solved is

    minimise  |W Rᵀ φ(q)|²   over the joint angles q that have   x(q) = x*

with the tool point x [m], its goal x*, and the rotation vector φ [rad] from the tool to its goal R. W weighs the tilt
of the tool's axis (x and y of the tool) and the turn about it (z). Gauss–Newton steps in the null space of the
constraint (Nocedal & Wright, Numerical Optimization, 2nd ed., sec. 15.3, with the objective linearised). Where that
asks a joint for more than a correction may, |q - q0|² is added with growing weight, until only the place is left.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from planner.common.determinism import Positions
from planner.common.units import DEG, MM, Array, read_only
from planner.compensation.tolerances import (
    JACOBIAN_STEP,
    LARGEST_STEP,
    LOST_TRAVEL_SHARE,
    LOST_TURN_SHARE,
    POINT_REACHED,
    SOLVED,
)
from planner.kinematics.inverse_kinematics import rotation_between, shorten, solve_ik
from planner.kinematics.robot import Robot

FULL_AXES = 6  # with fewer an arm cannot bring its tool to every pose near one that it reaches


class FlangeSource(Protocol):
    """What gives the pose of a robot's flange."""

    def flange(self, q: Array) -> tuple[Array, Array]:
        """Return p_BF (n, 3) [m] and R_BF (n, 3, 3) at controller angles q (n, N) [rad]."""


@dataclass(frozen=True)
class TurnWeights:
    """What a tilt of the tool's axis counts, and what a turn about it; the tool's place comes before both."""

    axis: float = 1.0
    spin: float = 0.3

    @property
    def row(self) -> Array:
        """One number for each axis of the tool, (3,)."""
        return np.array([self.axis, self.axis, self.spin])


@dataclass(frozen=True)
class ToolGoal:
    """Where the tools of n targets ought to be.

    Attributes:
        T_FT: tools in the flange, (n, 4, 4) [m].
        x: tool points in the base frame, (n, 3) [m].
        R: the tools' turns in the base frame, (n, 3, 3).
    """

    T_FT: Array
    x: Array
    R: Array

    @classmethod
    def of(cls, poser: FlangeSource, q: Array, T_FT: Array) -> "ToolGoal":
        """Return where the tools ``T_FT`` (n, 4, 4) [m] are at angles q (n, N) [rad]."""
        p, R = poser.flange(q)
        return cls(T_FT, p + np.einsum("nij,nj->ni", R, T_FT[:, :3, 3]), R @ T_FT[:, :3, :3])

    def rows(self, at: np.ndarray) -> "ToolGoal":
        """Return those of the targets ``at``."""
        return ToolGoal(self.T_FT[at], self.x[at], self.R[at])

    def missing_motion(self, poser: FlangeSource, q: Array) -> tuple[Array, Array]:
        """Return the motion still needed at q (n, N) [rad]: travel (n, 3) [m, base] and turn (n, 3) [rad, tool]."""
        now = ToolGoal.of(poser, q, self.T_FT)
        return self.x - now.x, np.einsum("nji,nj->ni", self.R, rotation_between(now.R, self.R))


@dataclass(frozen=True)
class ToolDeviation:
    """How far n tools are from where they ought to be.

    Attributes:
        distance: of the tool point, (n,) [m].
        tilt: of the tool's z axis, (n,) [rad].
        spin: about that axis, (n,) [rad].
    """

    distance: Array
    tilt: Array
    spin: Array

    @classmethod
    def at(cls, goal: ToolGoal, poser: FlangeSource, q: Array) -> "ToolDeviation":
        """Return how far the tools of ``poser`` at angles q (n, N) [rad] are from the goal."""
        travel, turn = goal.missing_motion(poser, q)
        tilt, spin = np.linalg.norm(turn[:, :2], axis=1), np.abs(turn[:, 2])
        return cls(read_only(np.linalg.norm(travel, axis=1)), read_only(tilt), read_only(spin))


@dataclass(frozen=True)
class TurnsLeft:
    """How far the tools of an arm with fewer than six axes are off, by the calibrated model.

    Attributes:
        axes: number of the arm's axes.
        lines: of the file, one for each target, (n,) int.
        before, after: uncorrected, and at the numbers as printed.
    """

    axes: int
    lines: tuple[int, ...]
    before: ToolDeviation
    after: ToolDeviation

    @property
    def nearer_share(self) -> float:
        """Share of the targets whose tool point came nearer."""
        return float((self.after.distance < self.before.distance).mean())

    @property
    def sentences(self) -> tuple[str, ...]:
        """Say what was met and what is left, over all targets and of those where most is left."""
        b, a = self.before, self.after
        worst = np.argsort(-np.hypot(a.tilt, a.spin), kind="stable")[:5]  # targets are told one by one
        told = ", ".join(
            f"line {self.lines[k]} {a.tilt[k] / DEG:.2f}° and {a.spin[k] / DEG:.2f}°" for k in np.sort(worst)
        )
        return (
            f"an arm of {self.axes} axes brings its tool to a place, and turns it as nearly as it can. "
            f"Off by the model, rms before → after: tool point "
            f"{_rms(b.distance) / MM:.2f} → {_rms(a.distance) / MM:.3f} mm "
            f"(worst {b.distance.max() / MM:.2f} → {a.distance.max() / MM:.3f}), its axis {_rms(b.tilt) / DEG:.2f} → "
            f"{_rms(a.tilt) / DEG:.2f}°, its turn about the axis {_rms(b.spin) / DEG:.2f} → "
            f"{_rms(a.spin) / DEG:.2f}°. {self.nearer_share:.0%} of the targets came nearer",
            f"most of a turn (of the axis, about it) is left at: {told}",
        )

    def content(self) -> list[dict[str, float]]:
        """Return the summary in numbers, line by line."""
        return [
            {"line": line, **_numbers("before", self.before, k), **_numbers("after", self.after, k)}
            for k, line in enumerate(self.lines)
        ]


def _rms(x: Array) -> float:
    return float(np.sqrt((x**2).mean()))


def _numbers(when: str, d: ToolDeviation, k: int) -> dict[str, float]:
    return {
        f"{when}_mm": round(float(d.distance[k] / MM), 5),
        f"axis_{when}_deg": round(float(d.tilt[k] / DEG), 5),
        f"about_axis_{when}_deg": round(float(d.spin[k] / DEG), 5),
    }


def solve_few_axes(
    robot: Robot, poser: FlangeSource, start: Array, goal: ToolGoal, weights: TurnWeights, farthest: float
) -> Array:
    """Return angles (n, N) [rad] at which the tool stands where it ought to, turned as nearly as the arm can.

    A joint that would leave its limits is held at its limit, and the others take the place as well as they can. Where
    the place asks a joint for more than ``farthest`` it is held there in the same way: the tool comes nearer.

    Args:
        robot: the limits.
        poser: the robot as it is.
        start: where to start, (n, N) [rad].
        goal: where the tools ought to be.
        weights: of the turns.
        farthest: that a joint may move [rad].
    """
    within = robot.q_lower, robot.q_upper
    room = farthest * (1 - 1e-9)  # so that rounding does not make it more
    near = np.maximum(within[0], start - room), np.minimum(within[1], start + room)
    q, rows, error = start.copy(), np.arange(len(start)), np.full(len(start), np.inf)
    # ((1.0, 0.0), (1.0, 0.1), (1.0, 0.3), (0.0, 1.0)): parts of what the turns and the joints' own moves count
    tries = ((1.0, 0.0, within), (1.0, 0.1, within), (1.0, 0.3, within), (0.0, 1.0, within), (0.0, 1.0, near))
    for turns, hold, box in tries:
        row = np.append(turns * weights.row, hold)
        low, high = (np.broadcast_to(end, start.shape)[rows] for end in box)
        tried = _solve_within(low, high, _Search(poser, goal.rows(rows), row, start[rows]))
        off = np.linalg.norm(goal.rows(rows).missing_motion(poser, tried)[0], axis=1)
        moved = np.abs(tried - start[rows]).max(axis=1, initial=0.0)
        better = np.where(moved <= farthest, off, np.inf) < error[rows]
        q[rows[better]], error[rows[better]] = tried[better], off[better]
        rows = rows[error[rows] > POINT_REACHED]
        if not rows.size:
            break
    farther = error > np.linalg.norm(goal.missing_motion(poser, start)[0], axis=1)
    q[farther] = start[farther]
    return q


@dataclass(frozen=True)
class _Search:
    """What is searched for: tools of ``poser`` at ``goal``, near ``start`` (n, N) [rad].

    ``row`` (4,): weights of the three turns in the tool's frame, and of the joints' moves.
    """

    poser: FlangeSource
    goal: ToolGoal
    row: Array
    start: Array

    def rows(self, at: np.ndarray) -> "_Search":
        """Return the search of the targets at some rows."""
        return _Search(self.poser, self.goal.rows(at), self.row, self.start[at])

    def solve(self, q: Array, free: np.ndarray) -> Array:
        """Step from q (n, N) until the steps have died away; joints that are not ``free`` (n, N) stay."""

        def task(q: Array, rows: Positions) -> tuple[Array, Array]:
            """Return the step of each target from q (m, N); without a Jacobian, as the step is solved for already."""
            return self.rows(np.asarray(rows)).step(q, free[rows]), np.empty((len(q), 0, 0))

        # 30: iterations: what is left of the turns makes the steps shrink by a factor of about ten each
        return solve_ik(task, q, step=lambda _, step: step, iterations=30, tolerance=SOLVED).best

    def step(self, q: Array, free: np.ndarray) -> Array:
        """Return the next change of the joints (n, N) [rad]: towards position, in its null space orientation."""
        n, N = q.shape
        travel, turn = self.goal.missing_motion(self.poser, q)
        J_x, J_turn = _jacobians(self.poser, q, self.goal)
        J_x, J_turn = J_x * free[:, None, :], J_turn * free[:, None, :] * self.row[:3, None]
        back = np.linalg.pinv(J_x, rcond=LOST_TRAVEL_SHARE)
        first = np.einsum("nij,nj->ni", back, travel)
        still = (np.eye(N) - back @ J_x) * free[:, :, None]
        hold = self.row[3] * np.broadcast_to(np.eye(N), (n, N, N))
        J = np.concatenate([J_turn, hold], axis=1)
        wanted = np.concatenate([turn * self.row[:3], self.row[3] * (self.start - q)], axis=1)
        wanted = wanted - np.einsum("nij,nj->ni", J, first)
        second = np.einsum("nij,nj->ni", np.linalg.pinv(J @ still, rcond=LOST_TURN_SHARE), wanted)
        step = (first + np.einsum("nij,nj->ni", still, second)) * free
        return shorten(step, np.abs(step).max(axis=1), LARGEST_STEP)


def _solve_within(low: Array, high: Array, search: _Search) -> Array:
    """Return the angles (n, N) [rad], joints that would leave their limits (n, N) held there."""
    free = np.ones(search.start.shape, dtype=bool)
    q = search.solve(search.start, free)
    for _ in range(3):  # times that joints which would leave their limits are held there and the others solved again
        over = free & ((q > high) | (q < low))
        rows = np.flatnonzero(over.any(axis=1))
        if not rows.size:
            break
        free[rows] &= ~over[rows]
        held = np.clip(q[rows], low[rows], high[rows])
        q[rows] = search.rows(rows).solve(held, free[rows])
    return np.asarray(np.clip(q, low, high))


def _jacobians(poser: FlangeSource, q: Array, goal: ToolGoal) -> tuple[Array, Array]:
    """Return the derivatives of what has been reached by the angles, by central differences, in one batch.

    Returns:
        Of the tool point (n, 3, N) [m/rad, base frame] and of its turn (n, 3, N) [rad/rad, tool frame].
    """
    n, N = q.shape
    shift = JACOBIAN_STEP * np.eye(N)
    both = (q[:, None, None, :] + np.stack([shift, -shift])[None]).reshape(-1, N)
    many = np.repeat(np.arange(n), 2 * N)
    travel, turn = (v.reshape(n, 2, N, 3) for v in goal.rows(many).missing_motion(poser, both))
    slopes = (np.swapaxes(v[:, 1] - v[:, 0], 1, 2) / (2 * JACOBIAN_STEP) for v in (travel, turn))
    J_x, J_turn = slopes
    return J_x, J_turn
