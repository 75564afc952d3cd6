"""The shortest move along a stretch in closed form: up to a peak speed, on at that speed, and down, all jerk-limited.

Biagiotti and Melchiorri (2008), section 3.4. For a move without acceleration at its ends it is the very profile that
ruckig finds; it has no tolerances, so it answers where ruckig's, which are absolute, leave it without one: a change
of speed that fills its stretch, or a speed that starts or ends within rounding of its bound.
"""

import numpy as np

from planner.trajectory.limits import Mask
from planner.trajectory.ramp import ramp_length
from planner.units import Array

BISECTIONS = 100  # of the peak speed, to the last bit


def double_s(length: Array, v0: Array, v1: Array, fastest: Array, acceleration: Array, jerk: Array) -> Array:
    """Return duration, s, ds/dt, d²s/dt² and d³s/dt³ at the start of the seven phases of each move, (n, 7, 5).

    All (n,), s [m] from 0 to ``length`` > 0, the speeds v0 and v1 [m/s] at its ends no more than ``fastest``, and a
    move that is possible: ``ramp_length(v0, v1, acceleration, jerk) <= length``.
    """
    peak = _peak(length, v0, v1, fastest, acceleration, jerk)
    out = np.zeros((len(length), 7, 5))
    up, down = _ramp(v0, peak, acceleration, jerk), _ramp(v1, peak, acceleration, jerk)
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


def _peak(length: Array, v0: Array, v1: Array, fastest: Array, acceleration: Array, jerk: Array) -> Array:
    """Return the highest speed (n,) [m/s] that leaves room for both ramps."""

    def fits(peak: Array) -> Mask:
        return np.asarray(
            ramp_length(v0, peak, acceleration, jerk) + ramp_length(peak, v1, acceleration, jerk) <= length
        )

    low, high = np.maximum(v0, v1), np.maximum(fastest, np.maximum(v0, v1))
    low = np.where(fits(high), high, low)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        inside = fits(middle)
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return np.asarray(low)


def _ramp(low: Array, high: Array, acceleration: Array, jerk: Array) -> Array:
    """Durations (n, 3) [s] of rising, holding and falling acceleration in a change from ``low`` to ``high`` speed."""
    change = high - low
    rise = np.minimum(acceleration / jerk, np.sqrt(change / jerk))
    hold = np.maximum(change / acceleration - acceleration / jerk, 0.0)
    return np.stack([rise, hold, rise], axis=1)
