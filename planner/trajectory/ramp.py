"""Jerk-limited changes of speed with zero acceleration at both ends, in closed form and for many at once.

Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots (2008), section 3.4: double-S profile.
These formulas choose speeds and stretches; the motion itself is timed by ruckig.
"""

import numpy as np

from planner.units import Array

BISECTIONS = 10  # the peak speed to 1e-3 of a range that is narrow already: enough to compare two ways


def ramp_time(change: Array, acceleration: Array, jerk: Array) -> Array:
    """Return the shortest time [s] for a change of speed ≥ 0."""
    return np.where(
        change * jerk >= acceleration**2,
        acceleration / jerk + change / acceleration,
        2.0 * np.sqrt(change / jerk),
    )


def ramp_length(v0: Array, v1: Array, acceleration: Array, jerk: Array) -> Array:
    """Return the way [m] that the shortest change from v0 to v1 takes; it is the same from v1 to v0."""
    return 0.5 * (v0 + v1) * ramp_time(np.abs(v1 - v0), acceleration, jerk)


def reachable(v0: Array, length: Array, acceleration: Array, jerk: Array) -> Array:
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
    top = np.maximum(v0, v1)
    possible = (top <= fastest) & (ramp_length(v0, v1, acceleration, jerk) <= length)
    fastest = np.maximum(fastest, top)

    def way(peak: Array) -> Array:
        return ramp_length(v0, peak, acceleration, jerk) + ramp_length(peak, v1, acceleration, jerk)

    def either(part: Array) -> Array:
        return np.minimum(reachable(v0, part, acceleration, jerk), reachable(v1, part, acceleration, jerk))

    # the peak is reached over half the length at least, and over no more than all of it
    low = np.minimum(np.maximum(top, either(0.5 * length)), fastest)
    high = np.minimum(np.maximum(top, either(length)), fastest)
    reached = way(high) <= length  # the highest at once: then it cruises there, or is within rounding of the peak
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        short = way(middle) <= length
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    peak = np.where(reached, high, low)
    rest = np.maximum(length - way(peak), 0.0)
    moving = ramp_time(peak - v0, acceleration, jerk) + ramp_time(peak - v1, acceleration, jerk)
    return np.where(possible, moving + rest / peak, np.inf)
