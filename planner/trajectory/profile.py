"""Which speeds to hold where: a shortest path through (end of stretch, speed), each step one jerk-limited move.

A step joins 1, 2, 3, 4, 6, … neighbouring stretches under their common bounds and has no acceleration at its ends, so
a change of speed need not fit into one short stretch. Forward and backward passes give the highest speed that can be
reached and left at every end; the shortest path picks among a few speeds up to it. Speeds found by passes over single
stretches are always among them, so there is always an answer. Bounds follow from the triangle inequality on
q̇ = q′ṡ, q̈ = q″ṡ² + q′s̈ and q⃛ = q‴ṡ³ + 3q″ṡs̈ + q′s⃛.
"""

from dataclasses import dataclass

import numpy as np

from planner.trajectory.limits import Index, Limits
from planner.trajectory.ramp import reachable, travel_time
from planner.trajectory.stretches import SHARE, Stretches, speed_bound
from planner.units import Array

WIDTHS = (1, 2, 3, 4, 6, 8, 12, 16, 32, 64, 128)  # stretches that one step may join
SHARES = (SHARE, 0.3)  # of acceleration and jerk for curvature: fast and even, or slower with room to change
LEVELS = 4  # speeds tried at each end, from the single-stretch passes up to the highest reachable
SAFE = (1e-4, 1e-12)  # held back from a change of speed, relative to it and to the speed: room for tolerances
USEFUL = 1.0 - 1e-9  # of the time over single stretches: a wider step must be able to beat it


@dataclass(frozen=True)
class Steps:
    """Moves from end ``first`` to end ``last``: length [m], and the bounds on ds/dt, d²s/dt², d³s/dt³; all (n,).

    v0 and v1 (n,) [m/s] are the speeds at either end once they are chosen (zero before).
    """

    first: Index
    last: Index
    length: Array
    speed: Array
    acceleration: Array
    jerk: Array
    v0: Array
    v1: Array

    def take(self, rows: Index) -> "Steps":
        """Return these rows."""
        return Steps(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def between(self, v0: Array, v1: Array) -> "Steps":
        """Return the same moves with these speeds at their ends."""
        return Steps(self.first, self.last, self.length, self.speed, self.acceleration, self.jerk, v0, v1)

    def time(self) -> Array:
        """Return the shortest times (n,) [s]; inf where a move cannot be made."""
        return travel_time(self.length, self.v0, self.v1, self.speed, self.acceleration, self.jerk)


def choose(stretches: Stretches, limits: Limits) -> Steps:
    """Return the steps of the fastest way found from the first end to the last, in order."""
    count = len(stretches.edge)
    single = _steps(stretches, limits, 1, SHARES[0])
    base = _speeds(single, stretches, single.speed)
    base_time = np.concatenate([[0.0], np.cumsum(single.between(base[:-1], base[1:]).time())])
    found = [single]
    for width in WIDTHS:
        if width >= count:
            break
        for share in SHARES[1:] if width == 1 else SHARES:
            wide = _steps(stretches, limits, width, share)
            useful = wide.length / wide.speed < (base_time[wide.last] - base_time[wide.first]) * USEFUL
            found.append(wide.take(np.flatnonzero(useful)))
    steps = Steps(*(np.concatenate([getattr(f, name) for f in found]) for name in single.__dataclass_fields__))
    top = np.maximum(_speeds(steps, stretches, single.speed), base)
    levels = base + (top - base) * (np.arange(LEVELS) / (LEVELS - 1))[:, None]
    return _shortest(steps, levels)


def _steps(stretches: Stretches, limits: Limits, width: int, share: float) -> Steps:
    """Return every run of ``width`` stretches without a rest inside, as a step under the bounds of the whole run."""
    d1, d2, d3, tool = stretches.d1, stretches.d2, stretches.d3, stretches.tool
    joined = 1
    while joined < width:  # runs of up to twice the length, from two that overlap or touch
        reach = min(joined, width - joined)
        d1, d2, d3 = (np.maximum(d[:-reach], d[reach:]) for d in (d1, d2, d3))
        tool = np.minimum(tool[:-reach], tool[reach:])
        joined += reach
    first = np.arange(len(tool))
    rests = np.concatenate([[0], np.cumsum(stretches.rest)])
    whole = rests[first + width] == rests[first + 1]
    first, d1, d2, d3, tool = first[whole], d1[whole], d2[whole], d3[whole], tool[whole]
    last = first + width
    speed = speed_bound(d1, d2, d3, tool, limits, share)
    v = speed[:, None]
    with np.errstate(divide="ignore"):
        left = limits.jerk - d3 * v**3
        acceleration = np.minimum((limits.acceleration - d2 * v**2) / d1, 0.5 * left / (3.0 * d2 * v)).min(axis=1)
        jerk = ((left - 3.0 * d2 * v * acceleration[:, None]) / d1).min(axis=1)
    none = np.zeros(len(first))
    length = stretches.edge[last] - stretches.edge[first]
    return Steps(first, last, length, speed, acceleration, jerk, none, none)


def _speeds(steps: Steps, stretches: Stretches, single: Array) -> Array:
    """Return the highest speeds (S+1,) at the ends that a forward and a backward pass over ``steps`` allow."""
    cap = np.minimum(np.concatenate([[np.inf], single]), np.concatenate([single, [np.inf]]))
    cap[stretches.rest] = 0.0
    forth = _pass(cap, steps.first, steps.last, steps)
    back = _pass(cap, steps.last, steps.first, steps)
    return np.minimum(forth, back)


def _pass(cap: Array, source: Index, target: Index, steps: Steps) -> Array:
    """Lower ``cap`` until each end can be reached from some source; at most one sweep per end is needed, mostly few."""
    order = np.argsort(target, kind="stable")
    source, target = source[order], target[order]
    limit = tuple(x[order] for x in (steps.length, steps.acceleration, steps.jerk))
    fastest = steps.speed[order]
    ends, starts = np.unique(target, return_index=True)
    speed = cap.copy()
    for _ in range(len(cap)):
        slow = np.minimum(speed[source], fastest)
        change = (reachable(slow, *limit) - slow) * (1.0 - SAFE[0]) - SAFE[1] * slow
        reach = np.minimum(slow + np.maximum(change, 0.0), fastest)
        lowered = speed.copy()
        lowered[ends] = np.minimum(speed[ends], np.maximum.reduceat(reach, starts))
        if np.array_equal(lowered, speed):
            break
        speed = lowered
    return speed


def _shortest(steps: Steps, levels: Array) -> Steps:
    """Return the quickest chain of steps from first end to last; levels (L, S+1) are the speeds to choose from."""
    count = len(levels)
    fresh = np.vstack([np.ones(levels.shape[1], dtype=bool), np.diff(levels, axis=0) > 1e-3 * levels[1:]])
    out, into = (grid.ravel() for grid in np.meshgrid(np.arange(count), np.arange(count), indexing="ij"))
    usable = fresh[out[:, None], steps.first] & fresh[into[:, None], steps.last]
    pair, row = np.nonzero(usable)
    tried = steps.take(row)
    tried = tried.between(levels[out[pair], tried.first], levels[into[pair], tried.last])
    time = tried.time()
    keep = np.flatnonzero(np.isfinite(time))
    keep = keep[np.argsort(tried.last[keep], kind="stable")]
    state = (tried.first * count + out[pair])[keep].tolist()
    target = (tried.last * count + into[pair])[keep].tolist()
    best = np.full(levels.size, np.inf).tolist()
    came = [-1] * levels.size
    best[0] = 0.0
    for i, (a, b, t) in enumerate(zip(state, target, time[keep].tolist(), strict=True)):
        if best[a] + t < best[b]:
            best[b] = best[a] + t
            came[b] = i
    chain = []
    node = (levels.shape[1] - 1) * count
    while node > 0:
        chain.append(came[node])
        node = state[came[node]]
    return tried.take(keep[np.array(chain[::-1], dtype=np.intp)])
