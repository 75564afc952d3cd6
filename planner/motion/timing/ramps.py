"""Jerk-limited changes of speed and double-S moves in closed form, many at once (Biagiotti and Melchiorri 2008,
section 3.4)."""

import numpy as np

from planner.common.units import Array
from planner.motion.timing.curve import Mask


def ramp_time(change: Array, acceleration: Array, jerk: Array) -> Array:
    """Return the shortest time [s] for a change of speed ≥ 0."""
    return np.where(
        change * jerk >= acceleration**2, acceleration / jerk + change / acceleration, 2.0 * np.sqrt(change / jerk)
    )


def ramp_length(v0: Array, v1: Array, acceleration: Array, jerk: Array) -> Array:
    """Return the way [m] that the shortest change from v0 to v1 takes; it is the same from v1 to v0."""
    return 0.5 * (v0 + v1) * ramp_time(np.abs(v1 - v0), acceleration, jerk)


def reachable_speed(v0: Array, length: Array, acceleration: Array, jerk: Array) -> Array:
    """Return the highest speed that can be reached from v0, or from which v0 can be reached, over ``length``."""
    # jerk alone: x = ramp_time/2 solves j x³ + 2 v0 x = length, by Cardano and one Newton step
    p, half = 2.0 * v0 / jerk, 0.5 * length / jerk
    u = np.cbrt(half + np.sqrt(half**2 + (p / 3.0) ** 3))
    x = u - p / (3.0 * u)
    x = x - (x**3 + p * x - 2.0 * half) / (3.0 * x**2 + p)
    # with a stretch at full acceleration: Δ² /a + Δ (a/j + 2 v0/a) + 2 v0 a/j − 2 length = 0
    b = acceleration / jerk + 2.0 * v0 / acceleration
    c = 2.0 * (v0 * acceleration / jerk - length)
    root = np.sqrt(np.maximum(b**2 - 4.0 * c / acceleration, 0.0))
    full = -2.0 * c / (b + root)
    return v0 + np.where(jerk * x > acceleration, full, jerk * x**2)


def travel_time(length: Array, v0: Array, v1: Array, fastest: Array, acceleration: Array, jerk: Array) -> Array:
    """Return the shortest time [s] over ``length`` from v0 to v1, never above ``fastest``; inf where impossible."""
    possible = (np.maximum(v0, v1) <= fastest) & (ramp_length(v0, v1, acceleration, jerk) <= length)
    out = np.full(possible.shape, np.inf)
    moves = np.broadcast_arrays(length, v0, v1, fastest, acceleration, jerk)
    out[possible] = _possible_time(*(x[possible] for x in moves))
    return out


def _possible_time(length: Array, v0: Array, v1: Array, fastest: Array, acceleration: Array, jerk: Array) -> Array:
    # the peak is reached over half the length at least, and over no more than all of it
    peak = _peak_within(length, v0, v1, fastest, acceleration, jerk)
    room = length - _two_ramps(v0, v1, peak, acceleration, jerk)
    open_ = np.flatnonzero(room < 0.0)  # elsewhere the highest at once: it cruises there, or is within rounding of it
    moves = [x[open_] for x in (length, v0, v1, fastest, acceleration, jerk)]
    low, high = _peak_within(0.5 * moves[0], *moves[1:]), peak[open_]
    for _ in range(10):  # the peak speed to 1e-3 of a range that is narrow already: enough to compare two ways
        middle = 0.5 * (low + high)
        short = _two_ramps(moves[1], moves[2], middle, moves[4], moves[5]) <= moves[0]
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    peak[open_], room[open_] = low, moves[0] - _two_ramps(moves[1], moves[2], low, moves[4], moves[5])
    moving = ramp_time(peak - v0, acceleration, jerk) + ramp_time(peak - v1, acceleration, jerk)
    return np.asarray(moving + np.maximum(room, 0.0) / peak)


def _peak_within(part: Array, v0: Array, v1: Array, fastest: Array, acceleration: Array, jerk: Array) -> Array:
    """Return the highest speed, ``fastest`` at most, that both ends reach over a ``part`` of the length."""
    reached = [reachable_speed(v, part, acceleration, jerk) for v in (v0, v1)]
    return np.minimum(np.maximum(np.maximum(v0, v1), np.minimum(*reached)), fastest)


def _two_ramps(v0: Array, v1: Array, peak: Array, acceleration: Array, jerk: Array) -> Array:
    return ramp_length(v0, peak, acceleration, jerk) + ramp_length(peak, v1, acceleration, jerk)


def double_s_phases(length: Array, v0: Array, v1: Array, fastest: Array, acceleration: Array, jerk: Array) -> Array:
    """Return duration, s, ds/dt, d²s/dt² and d³s/dt³ at the start of the seven phases of each move, (n, 7, 5).

    All (n,), s [m] from 0 to ``length`` > 0, the speeds v0 and v1 [m/s] at its ends no more than ``fastest``, and a
    move that is possible: ``ramp_length(v0, v1, acceleration, jerk) <= length``.
    """
    peak = _peak_speed(length, v0, v1, fastest, acceleration, jerk)
    out = np.zeros((len(length), 7, 5))
    up, down = _ramp_durations(v0, peak, acceleration, jerk), _ramp_durations(v1, peak, acceleration, jerk)
    rest = length - ramp_length(v0, peak, acceleration, jerk) - ramp_length(peak, v1, acceleration, jerk)
    out[:, :3, 0], out[:, 4:, 0] = up, down
    out[:, 3, 0] = np.maximum(rest, 0.0) / peak
    for phase, sign in ((0, 1.0), (2, -1.0), (4, -1.0), (6, 1.0)):
        out[:, phase, 4] = sign * jerk
    out[:, 1, 3] = out[:, 2, 3] = jerk * up[:, 0]
    out[:, 5, 3] = out[:, 6, 3] = -jerk * down[:, 0]
    gain = 0.5 * jerk[:, None] * np.stack([up[:, 0] ** 2, down[:, 0] ** 2], axis=1)
    out[:, 0, 2], out[:, 1, 2], out[:, 2, 2] = v0, v0 + gain[:, 0], peak - gain[:, 0]
    out[:, 3, 2], out[:, 4, 2] = peak, peak
    out[:, 5, 2], out[:, 6, 2] = peak - gain[:, 1], v1 + gain[:, 1]
    t, v, a, j = out[:, :-1, 0], out[:, :-1, 2], out[:, :-1, 3], out[:, :-1, 4]
    out[:, 1:, 1] = np.cumsum(t * (v + t * (a / 2.0 + t * j / 6.0)), axis=1)
    return out


def _peak_speed(length: Array, v0: Array, v1: Array, fastest: Array, acceleration: Array, jerk: Array) -> Array:
    """Return the highest speed (n,) [m/s] that leaves room for both ramps."""

    def fits(peak: Array) -> Mask:
        """Tell whether a move with this peak speed is no longer than the way."""
        return np.asarray(
            ramp_length(v0, peak, acceleration, jerk) + ramp_length(peak, v1, acceleration, jerk) <= length
        )

    low, high = np.maximum(v0, v1), np.maximum(fastest, np.maximum(v0, v1))
    low = np.where(fits(high), high, low)
    for _ in range(100):  # of the peak speed, to the last bit
        middle = 0.5 * (low + high)
        inside = fits(middle)
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return np.asarray(low)


def _ramp_durations(low: Array, high: Array, acceleration: Array, jerk: Array) -> Array:
    """Durations (n, 3) [s] of rising, holding and falling acceleration in a change from ``low`` to ``high`` speed."""
    change = high - low
    rise = np.minimum(acceleration / jerk, np.sqrt(change / jerk))
    hold = np.maximum(change / acceleration - acceleration / jerk, 0.0)
    return np.stack([rise, hold, rise], axis=1)
