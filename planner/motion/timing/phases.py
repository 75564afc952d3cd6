"""From chosen steps to time: each a double-S move along the path, laid end to end."""

from dataclasses import dataclass

import numpy as np

from planner.common.errors import PlannerError
from planner.common.units import Array, read_only
from planner.motion.timing.profile import Steps
from planner.motion.timing.ramps import double_s_phases


@dataclass(frozen=True)
class Phases:
    """s(t) as K polynomials of degree three.

    t (K,) [s] when each begins; s [m], speed [m/s], acceleration [m/s²] at that time and jerk [m/s³] throughout, each
    (K,); begin, end (K,) the s between which the step that a phase belongs to moves; duration [s] of all together.
    """

    t: Array
    s: Array
    speed: Array
    acceleration: Array
    jerk: Array
    begin: Array
    end: Array
    duration: float

    def at(self, t: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return s, ds/dt, d²s/dt², d³s/dt³ and the step's last s, each (n,), at times t (n,) in [0, duration]."""
        k = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, None)
        x = t - self.t[k]
        v, a, j = self.speed[k], self.acceleration[k], self.jerk[k]
        s = self.s[k] + x * (v + x * (a / 2.0 + x * j / 6.0))
        s = np.clip(s, self.begin[k], self.end[k])
        return s, v + x * (a + x * j / 2.0), a + x * j, j, self.end[k]

    def time_at(self, s: Array) -> Array:
        """Return the first time (n,) at which each s (n,) is reached."""
        k = np.clip(np.searchsorted(self.s, s, side="left") - 1, 0, None)
        low = self.t[k]
        high = np.append(self.t, self.duration)[k + 1]
        for _ in range(60):
            middle = 0.5 * (low + high)
            x = middle - self.t[k]
            way = self.s[k] + x * (self.speed[k] + x * (self.acceleration[k] / 2.0 + x * self.jerk[k] / 6.0))
            low, high = np.where(way < s, middle, low), np.where(way < s, high, middle)
        return high


def time_steps(steps: Steps, edge: Array, wait: Array) -> tuple[Phases, Array]:
    """Time the steps that end at ``edge`` [m], with a rest of ``wait`` [s] at each end, both (S + 1,).

    Returns the phases and the time (S+1,) [s] of arrival at each end at which a step begins or ends, NaN at the others.
    """
    moves = _time_moves(steps)
    moves[:, :, 1] += edge[steps.first][:, None]
    at = np.append(steps.first, len(edge) - 1)
    rest = np.zeros((len(at), 1, 5))
    rest[:, 0, 0], rest[:, 0, 1] = wait[at], edge[at]
    nothing = np.zeros((1, 7, 5))
    table = np.concatenate([rest, np.concatenate([moves, nothing])], axis=1).reshape(-1, 5)[:-7]
    start = np.concatenate([[0.0], np.cumsum(table[:, 0])])
    arrival = np.full(len(edge), np.nan)
    arrival[at] = start[:-1:8]
    kept = table[:, 0] > 0.0
    kept[-1] = True  # the rest at the end, though it lasts no time
    s, speed, acceleration, jerk = (read_only(column) for column in table[kept, 1:].T)
    rows = np.repeat(np.arange(len(at)), 8)[:-7]
    is_rest = np.arange(len(rows)) % 8 == 0
    begin, end = edge[at[rows]], edge[at[np.minimum(rows + ~is_rest, len(at) - 1)]]
    t = read_only(start[:-1][kept])
    phases = Phases(t, s, speed, acceleration, jerk, read_only(begin[kept]), read_only(end[kept]), float(start[-1]))
    return phases, read_only(arrival)


def stand_still(wait: float) -> Phases:
    """Return the phases of a tour that rests at its only point for ``wait`` [s]."""
    zero = read_only(np.zeros(1))
    return Phases(zero, zero, zero, zero, zero, zero, zero, wait)


def _time_moves(steps: Steps) -> Array:
    """Return duration, s, ds/dt, d²s/dt², d³s/dt³ at the start of the seven phases of every step: (n, 7, 5)."""
    if not np.isfinite(steps.time()).all():
        raise PlannerError("a step of the path was given speeds that its limits do not allow")
    return double_s_phases(steps.length, steps.v0, steps.v1, steps.speed, steps.acceleration, steps.jerk)
