"""Correction of arms with fewer than six axes: the tool's place first, then its axis, then its turn.

Such an arm cannot bring its tool to every pose near one that it reaches: an SO-101 has four axes that move its tool in
one plane, so that a skewed calibrated arm tilts it out of that plane and no joint takes that back. What is solved is

    minimise  w² |x(q) - x*|² + |W Rᵀ φ(q)|² + h² |q - q0|²   over joint angles q within their bounds

with the tool point x [m], its goal x*, and the rotation vector φ [rad] from the tool to its goal R. W weighs the tilt
of the tool's axis (x and y of the tool) and the turn about it (z). The weight w of the place is so large that no turn
moves it by more than a program prints; h decides only where neither counts. Bounds are the joints' limits, and how far
a correction may move a joint. The steps are those of Levenberg and Marquardt (Nocedal & Wright, Numerical Optimization,
2nd ed., sec. 10.3): the cost falls with each, so two computers that round differently end at the same angles.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from planner.common.units import DEG, MM, Array, read_only
from planner.compensation.tolerances import JACOBIAN_STEP, MOVE_WEIGHT, PLACE_WEIGHTS, SOLVED
from planner.kinematics.inverse_kinematics import rotation_between
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

    def distance(self, poser: FlangeSource, q: Array) -> Array:
        """Return how far the tool points of ``poser`` at q (n, N) [rad] are away, (n,) [m]."""
        return np.asarray(np.linalg.norm(self.missing_motion(poser, q)[0], axis=1))

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

    No joint leaves its limits or moves by more than ``farthest``: where the place asks for that, the tool comes as near
    as it can.

    Args:
        robot: the limits.
        poser: the robot as it is.
        start: where to start, (n, N) [rad].
        goal: where the tools ought to be.
        weights: of the turns.
        farthest: that a joint may move [rad].
    """
    room = farthest * (1 - 1e-9)  # so that rounding does not make it more
    low, high = np.maximum(robot.q_lower, start - room), np.minimum(robot.q_upper, start + room)
    q = np.clip(start, low, high)
    for place in PLACE_WEIGHTS:  # the first lets the tool turn while it is still off its place
        q = _descend(_Search(poser, goal, np.r_[[place] * 3, weights.row], start, low, high), q)
    farther = goal.distance(poser, q) > goal.distance(poser, start)
    q[farther] = start[farther]
    return q


@dataclass(frozen=True)
class _Search:
    """What is searched for: tools of ``poser`` at ``goal``, near ``start`` (n, N) [rad] and within low and high.

    ``row`` (6,): what a travel counts [1/m], and what a turn [1/rad].
    """

    poser: FlangeSource
    goal: ToolGoal
    row: Array
    start: Array
    low: Array
    high: Array

    def rows(self, at: np.ndarray) -> "_Search":
        """Return the search of the targets at some rows."""
        return _Search(self.poser, self.goal.rows(at), self.row, self.start[at], self.low[at], self.high[at])

    def missing(self, q: Array) -> Array:
        """Return what is missing at q (n, N) [rad], weighted, and the joints' moves, (n, 6 + N)."""
        motion = np.concatenate(self.goal.missing_motion(self.poser, q), axis=1)
        return np.concatenate([motion * self.row, MOVE_WEIGHT * (self.start - q)], axis=1)

    def slopes(self, q: Array) -> Array:
        """Return what a move of the joints takes up of it, (n, 6 + N, N), by central differences."""
        n, N = q.shape
        shift = JACOBIAN_STEP * np.eye(N)
        both = (q[:, None, None, :] + np.stack([-shift, shift])).reshape(-1, N)
        ends = self.rows(np.repeat(np.arange(n), 2 * N)).missing(both).reshape(n, 2, N, -1)
        return np.swapaxes(ends[:, 0] - ends[:, 1], 1, 2) / (2 * JACOBIAN_STEP)

    def step(self, q: Array, missing: Array, J: Array, damping: Array) -> Array:
        """Return the change of the joints (n, N) [rad] that takes up most, damped (n,); none leaves its bounds."""
        n, N = q.shape
        down, up = self.low - q, self.high - q
        pull = np.einsum("nij,ni->nj", J, missing)
        free = ~((down >= 0) & (pull < 0) | (up <= 0) & (pull > 0))
        step = np.zeros((n, N))
        damped = np.concatenate([J, np.sqrt(damping)[:, None, None] * np.eye(N)], axis=1)
        for _ in range(N):  # joints that would leave are taken to their bound, and the others solved again
            left = np.pad(missing - np.einsum("nij,nj->ni", J, np.where(free, 0.0, step)), ((0, 0), (0, N)))
            solved = np.einsum("nij,nj->ni", np.linalg.pinv(damped * free[:, None, :]), left)
            step = np.where(free, solved, step)
            over = free & ((step < down) | (step > up))
            if not over.any():
                break
            step, free = np.clip(step, down, up), free & ~over
        return np.clip(step, down, up)


def _descend(search: _Search, q: Array) -> Array:
    """Return the angles (n, N) [rad] where the cost is least, downhill from q (n, N)."""
    q, rows, damping = q.copy(), np.arange(len(q)), np.full(len(q), 1e-2)  # 1e-2: of a turn that counts 1
    for _ in range(60):  # 60: steps at most; most targets take about ten
        now = search.rows(rows)
        missing = now.missing(q[rows])
        step = now.step(q[rows], missing, now.slopes(q[rows]), damping[rows])
        then = now.missing(q[rows] + step)
        down = (then**2).sum(axis=1) <= (missing**2).sum(axis=1)
        q[rows[down]] += step[down]
        damping[rows] *= np.where(down, 0.1, 8.0)
        rows = rows[np.abs(step).max(axis=1) > SOLVED]
        if not rows.size:
            break
    return np.clip(q, search.low, search.high)
