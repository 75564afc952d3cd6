"""Which speeds to hold along the path: stretches with their bounds, and the quickest chain of jerk-limited moves
over them."""

from dataclasses import dataclass, replace

import numpy as np

from planner.common.units import Array, Rows, read_only
from planner.motion.timing.curve import Index, Limits, Mask, PathCurve, ReadingLimits, ToolJacobian
from planner.motion.timing.ramps import reachable_speed, travel_time
from planner.motion.tolerances import BLEND_SPEED_RATIO, CURVATURE_SHARE, STRAIGHT_SPEED_RATIO, STRETCH_CHANGE


@dataclass(frozen=True)
class Stretches:
    """S stretches in order along the path.

    edge (S+1,) their ends in s [m]; d1, d2, d3 (S, N) the largest |dq/ds|, |d²q/ds²|, |d³q/ds³| on each, with those of
    a gauge's reading behind the joints' where it has limits; tool (S,) the largest ds/dt [m/s] that the tool's speed
    limit allows; rest (S+1,) ends at which the motion stands still.
    """

    edge: Array
    d1: Array
    d2: Array
    d3: Array
    tool: Array
    rest: Mask


def speed_bound(d1: Array, d2: Array, d3: Array, tool: Array, limits: Limits, share: float) -> Array:
    """Return the largest ds/dt (…,) with |q′|ṡ ≤ v, |q″|ṡ² ≤ share·a and |q‴|ṡ³ ≤ share·j on every joint."""
    with np.errstate(divide="ignore"):
        joint = np.minimum(limits.speed / d1, np.sqrt(share * limits.acceleration / d2))
        joint = np.minimum(joint, np.cbrt(share * limits.jerk / d3))
    return np.asarray(np.minimum(joint.min(axis=-1), tool))


def cut_stretches(
    curve: PathCurve,
    passage: Array,
    stop: Mask,
    tool_speed: Array,
    jacobian: ToolJacobian,
    limits: Limits,
    reading: ReadingLimits | None = None,
) -> Stretches:
    """Cut the curve into stretches.

    passage (M,) [m] and stop (M,) per distinct path point, tool_speed (M-1,) [m/s] per leg. With ``reading`` the limits
    are those of :meth:`ReadingLimits.beside`.
    """
    s, piece, leg = _samples(curve, passage, tool_speed)
    # at a stop the tangent jumps: each interval takes both its ends on its own piece
    low, high = curve.derivatives(s[:-1], piece), curve.derivatives(s[1:], piece)
    margin = np.where(curve.blend[piece], BLEND_SPEED_RATIO, STRAIGHT_SPEED_RATIO)[:, None]
    d1, d2, d3 = (np.maximum(np.abs(a), np.abs(b)) * margin for a, b in zip(low[1:], high[1:], strict=True))
    tool = np.full(len(leg), np.inf)
    if np.isfinite(tool_speed).any() or reading is not None:
        states = np.concatenate([low[0], high[0][-1:]])
        jacobians = jacobian(states)
        begin = np.einsum("nij,nj->ni", jacobians[:-1], low[1])
        end = np.einsum("nij,nj->ni", jacobians[1:], high[1])
        with np.errstate(divide="ignore"):
            tool = tool_speed[leg] / (_largest_norm(begin, end, np.diff(s)) * STRAIGHT_SPEED_RATIO)
        if reading is not None:
            along = reading.direction(states)
            begin, end = (np.einsum("ni,ni->n", e, v) for e, v in ((along[:-1], begin), (along[1:], end)))
            rate, bend = _reading_derivatives(begin, end, np.diff(s))
            d1, d2 = np.column_stack([d1, rate]), np.column_stack([d2, bend])
            d3 = np.column_stack([d3, np.zeros(len(leg))])
    fastest = speed_bound(d1, d2, d3, tool, limits, CURVATURE_SHARE)
    marks = np.searchsorted(s, np.concatenate([curve.start, passage]))
    first = _first_intervals(fastest, marks[marks < len(fastest)])
    edge = np.concatenate([s[first], s[-1:]])
    rest = np.zeros(len(edge), dtype=bool)
    rest[np.searchsorted(edge, passage[stop])] = True
    d1, d2, d3 = (read_only(np.maximum.reduceat(d, first)) for d in (d1, d2, d3))
    return Stretches(read_only(edge), d1, d2, d3, read_only(np.minimum.reduceat(tool, first)), rest)


def _samples(curve: PathCurve, passage: Array, tool_speed: Array) -> tuple[Array, Index, Index]:
    """Return sample places s (n+1,), and of the intervals between them the piece (n,) and the leg (n,)."""
    low = np.unique(np.concatenate([curve.start, passage[:-1]]))
    high = np.concatenate([low[1:], [passage[-1]]])
    piece = curve.piece(low)
    leg = np.clip(np.searchsorted(passage, low, side="right") - 1, 0, len(tool_speed) - 1)
    travel = np.abs(curve.derivatives(high, piece)[0] - curve.derivatives(low, piece)[0]).max(axis=1)
    # 0.015: [rad] of joint travel between two samples
    count = np.where(np.isfinite(tool_speed[leg]), np.ceil(travel / 0.015), 1.0)
    # 24: intervals in either half of a blend
    count = np.maximum(count, np.where(curve.blend[piece], 24, 1)).astype(np.intp)
    run = np.repeat(np.arange(len(low)), count)
    within = np.arange(len(run)) - np.repeat(np.cumsum(count) - count, count)
    s = low[run] + (high - low)[run] * (within / count[run])
    return np.concatenate([s, high[-1:]]), piece[run], leg[run]


def _largest_norm(low: Array, high: Array, h: Array) -> Array:
    """Return the largest length (n,) of a vector on intervals h (n,), from its values (n, 3) at both their ends.

    Between two samples the vector leaves its chord by at most h²/8 of its second derivative, here taken from divided
    differences at both ends, and a chord is no longer than the longer of its ends.
    """
    slope = (high - low) / h[:, None]
    bend = np.zeros(len(h) + 1)
    bend[1:-1] = 2.0 * np.linalg.norm(np.diff(slope, axis=0), axis=1) / (h[:-1] + h[1:])
    # 1e-6: a relative change from one interval to the next that only a stop can make
    bend[1:-1][np.linalg.norm(high[:-1] - low[1:], axis=1) > 1e-6 * np.linalg.norm(low[1:], axis=1)] = 0.0
    longest = np.maximum(np.linalg.norm(low, axis=1), np.linalg.norm(high, axis=1))
    # 1/8 for a constant second derivative, and room for one that varies
    return np.asarray(longest + 0.2 * h**2 * np.maximum(bend[:-1], bend[1:]))


def _reading_derivatives(low: Array, high: Array, h: Array) -> tuple[Array, Array]:
    """Return the largest |dL/ds| and |d²L/ds²| of a reading L on intervals h, (n,) each, from dL/ds at both ends (n,).

    The second derivative is the mean over the interval, and as much more as it differs from that of its neighbours.
    """
    first = _largest_norm(low[:, None], high[:, None], h) * STRAIGHT_SPEED_RATIO
    second = (high - low) / h
    change = np.abs(np.diff(second, prepend=second[:1], append=second[-1:]))
    return first, np.abs(second) + np.maximum(change[:-1], change[1:])


def _first_intervals(fastest: Array, marks: Index) -> Index:
    """Return the first interval of each stretch: at every mark, and wherever the limit has drifted by 3 %."""
    drift = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(np.log(fastest))))])
    begins = np.zeros(len(fastest), dtype=bool)
    begins[marks] = True
    begins[1:] |= np.diff(np.floor(drift / STRETCH_CHANGE)) > 0
    return np.flatnonzero(begins)


SHARES = (CURVATURE_SHARE, 0.3)  # of acceleration and jerk for curvature: fast and even, or slower with room to change


@dataclass(frozen=True)
class Steps(Rows):
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

    def with_end_speeds(self, v0: Array, v1: Array) -> "Steps":
        """Return the same moves with these speeds at their ends."""
        return replace(self, v0=v0, v1=v1)

    def time(self) -> Array:
        """Return the shortest times (n,) [s]; inf where a move cannot be made."""
        return travel_time(self.length, self.v0, self.v1, self.speed, self.acceleration, self.jerk)


def choose_speeds(stretches: Stretches, limits: Limits) -> Steps:
    """Return the steps of the fastest way found from the first end to the last, in order."""
    levels_tried = 4  # speeds tried at each end, from the single-stretch passes up to the highest reachable
    count = len(stretches.edge)
    single = _steps(stretches, limits, 1, SHARES[0])
    base = _speeds(single, stretches, single.speed)
    base_time = np.concatenate([[0.0], np.cumsum(single.with_end_speeds(base[:-1], base[1:]).time())])
    found = [single]
    for width in (1, 2, 3, 4, 6, 8, 12, 16, 32, 64, 128):  # stretches that one step may join
        if width >= count:
            break
        for share in SHARES[1:] if width == 1 else SHARES:
            wide = _steps(stretches, limits, width, share)
            # 1.0 - 1e-9: of the time over single stretches: a wider step must be able to beat it
            useful = wide.length / wide.speed < (base_time[wide.last] - base_time[wide.first]) * (1.0 - 1e-9)
            found.append(wide.take(np.flatnonzero(useful)))
    steps = Steps.concatenate(found)
    top = np.maximum(_speeds(steps, stretches, single.speed), base)
    levels = base + (top - base) * (np.arange(levels_tried) / (levels_tried - 1))[:, None]
    return _quickest_chain(steps, levels)


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
    forth = _speed_pass(cap, steps.first, steps.last, steps)
    back = _speed_pass(cap, steps.last, steps.first, steps)
    return np.minimum(forth, back)


def _speed_pass(cap: Array, source: Index, target: Index, steps: Steps) -> Array:
    """Lower ``cap`` until each end can be reached from some source; at most one sweep per end is needed, mostly few."""
    order = np.argsort(target, kind="stable")
    source, target = source[order], target[order]
    limits = np.stack([steps.length, steps.acceleration, steps.jerk, steps.speed])[:, order]
    ends, starts = np.unique(target, return_index=True)
    speed = cap.copy()
    reach = _reach(speed[source], *limits)
    for _ in range(len(cap)):
        lowered = speed.copy()
        lowered[ends] = np.minimum(speed[ends], np.maximum.reduceat(reach, starts))
        again = np.flatnonzero((lowered < speed)[source])  # a step whose source stays gives what it gave
        if np.array_equal(lowered, speed):
            break
        speed = lowered
        reach[again] = _reach(speed[source[again]], *limits[:, again])
    return speed


def _reach(v0: Array, length: Array, acceleration: Array, jerk: Array, fastest: Array) -> Array:
    """Return the highest speeds (n,) [m/s] that steps reach from v0, with some of each change held back."""
    slow = np.minimum(v0, fastest)
    held_back = (1e-4, 1e-12)  # from a change of speed, relative to it and to the speed: room for tolerances
    change = (reachable_speed(slow, length, acceleration, jerk) - slow) * (1.0 - held_back[0]) - held_back[1] * slow
    return np.asarray(np.minimum(slow + np.maximum(change, 0.0), fastest))


def _quickest_chain(steps: Steps, levels: Array) -> Steps:
    """Return the quickest chain of steps from first end to last; levels (L, S+1) are the speeds to choose from."""
    count = len(levels)
    fresh = np.vstack([np.ones(levels.shape[1], dtype=bool), np.diff(levels, axis=0) > 1e-3 * levels[1:]])
    out, into = (grid.ravel() for grid in np.meshgrid(np.arange(count), np.arange(count), indexing="ij"))
    usable = fresh[out[:, None], steps.first] & fresh[into[:, None], steps.last]
    pair, row = np.nonzero(usable)
    tried = steps.take(row)
    tried = tried.with_end_speeds(levels[out[pair], tried.first], levels[into[pair], tried.last])
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
