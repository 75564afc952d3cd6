"""The path as driven, q(s): straights and blended corners, three times continuously differentiable.

Joint and tool limits, the checked request, and axis percentages for point-to-point moves.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planner.common.errors import InputError
from planner.common.units import Array, read_only
from planner.motion.tolerances import NO_JERK_LIMIT, PACE_RATIO, REVERSAL_COSINE, SAME_POINT, STRAIGHT_SPEED_RATIO

Mask = NDArray[np.bool_]
Index = NDArray[np.intp]

ToolPosition = Callable[[Array], Array]
"""Joint angles (n, N) [rad] to tool points (n, 3) [m]."""

ToolJacobian = Callable[[Array], Array]
"""Joint angles (n, N) [rad] to d(tool point)/dq (n, 3, N) [m/rad]."""


@dataclass(frozen=True)
class Limits:
    """Joint limits of the motion: speed [rad/s], acceleration [rad/s²] and jerk [rad/s³], each (N,), all > 0."""

    speed: Array
    acceleration: Array
    jerk: Array


@dataclass(frozen=True)
class ReadingLimits:
    """What a gauge that is held between a place and the tool follows: rate [m/s] and acceleration [m/s²].

    ``length`` maps joint angles (n, N) [rad] to its reading (n,) [m], ``direction`` to the unit vectors (n, 3) along
    which the reading grows as the tool point moves.
    """

    rate: float
    acceleration: float
    length: Callable[[Array], Array]
    direction: Callable[[Array], Array]

    def with_reading(self, limits: Limits) -> Limits:
        """Return joint limits with the reading as one more coordinate, the last."""
        return Limits(
            np.append(limits.speed, self.rate),
            np.append(limits.acceleration, self.acceleration),
            np.append(limits.jerk, NO_JERK_LIMIT),
        )


@dataclass(frozen=True)
class TimingRequest:
    """A polyline to be driven, checked: path_q (m, N) [rad], stop (m,), blend_m (m,), tool_speed (m-1,), dwell (m,)."""

    path_q: Array
    stop: Mask
    blend_m: Array
    tool_speed: Array
    dwell: Array


def check_request(
    path_q: ArrayLike, stop: ArrayLike, blend_m: ArrayLike, tool_speed: ArrayLike, dwell: ArrayLike, n_joints: int
) -> TimingRequest:
    """Return the caller's polyline with every array at full length; the first and last point are always stops.

    Radii count where the motion does not stop, dwells where it does.

    Raises:
        InputError: the path has not two points, or other joints than the limits.
    """
    q, rest = np.asarray(path_q, dtype=float), np.array(stop, dtype=bool)
    if len(q) < 2 or q.shape[1] != n_joints:
        raise InputError(f"a path of shape {q.shape} cannot be timed: it needs two or more poses of {n_joints} joints")
    rest[[0, -1]] = True
    radius, wait = np.where(rest, 0.0, blend_m), np.where(rest, dwell, 0.0)
    speed = np.broadcast_to(tool_speed, len(q) - 1)
    return TimingRequest(read_only(q), rest, read_only(radius), read_only(speed), read_only(wait))


def axis_percent(q: Array, *, tool_speed: ArrayLike, tool_jacobian: ToolJacobian, speed: Array) -> Array:
    """Return for each leg (m-1,) the highest axis percentage, to 100, that keeps the tool point within tool_speed.

    A synchronised point-to-point move at fraction f takes T/f with T = max_j |Δq_j|/speed_j; its tool point moves at up
    to f · max_σ |J(q(σ)) Δq| / T. q is (m, N) [rad], speed (N,) [rad/s], tool_speed one or (m-1,) [m/s], inf for none.
    """
    leg = np.diff(q, axis=0)
    quickest = (np.abs(leg) / speed).max(axis=1)
    count = np.ceil(np.abs(leg).max(axis=1) / 0.01).astype(np.intp) + 1  # [rad] between two samples of a leg
    run = np.repeat(np.arange(len(leg)), count)
    begin = np.cumsum(count) - count
    share = (np.arange(len(run)) - begin[run]) / np.maximum(count - 1, 1)[run]
    jacobian = tool_jacobian(q[run] + share[:, None] * leg[run])
    travel = np.linalg.norm(np.einsum("nij,nj->ni", jacobian, leg[run]), axis=1)
    peak = np.maximum.reduceat(travel, begin) * STRAIGHT_SPEED_RATIO
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = np.where(peak > 0.0, np.asarray(tool_speed, dtype=float) * quickest / peak, 1.0)
    return np.asarray(100.0 * np.minimum(fraction, 1.0))


@dataclass(frozen=True)
class Corners:
    """The polyline without its repeated points, and where each corner is cut.

    q (M, N) distinct points [rad]; node (m,) the distinct point of each path point; stop (M,) the points of rest,
    reversals and corners without a radius included; entry, exit (M, N) [rad] where the blend begins on the incoming
    and ends on the outgoing leg, equal to q at stops; share_in, share_out (M,) the parts of both legs that it takes, at
    most 1/2, 0 at stops; pace (M-1,) [rad/s] a joint-space speed at which each leg could be driven on average.
    Every blended path stays inside the triangles (entry, q, exit) and on the straight legs between them.
    """

    q: Array
    node: Index
    stop: Mask
    entry: Array
    exit: Array
    share_in: Array
    share_out: Array
    pace: Array


def distinct_points(path_q: Array) -> Index:
    """Return for each path point (m,) the number of its distinct point; a run of equal points shares one."""
    node = np.zeros(len(path_q), dtype=np.intp)
    kept = path_q[0]
    for i in range(1, len(path_q)):
        moved = float(np.linalg.norm(path_q[i] - kept)) > SAME_POINT
        node[i] = node[i - 1] + moved
        kept = path_q[i] if moved else kept
    return node


def round_corners(request: TimingRequest, tool_position: ToolPosition, speed: Array) -> Corners:
    """Find entry and exit of every corner: the tool point is blend_m away from it, at most half a leg.

    speed (N,) [rad/s] are the joints' limits. Where one side is short, the other is cut to PACE_RATIO times its time.
    """
    node = distinct_points(request.path_q)
    count = int(node[-1]) + 1
    first = np.searchsorted(node, np.arange(count))
    q = request.path_q[first]
    blend = np.minimum.reduceat(request.blend_m, first)
    leg = np.diff(q, axis=0)
    length = np.linalg.norm(leg, axis=1)
    stop = np.logical_or.reduceat(request.stop, first) | (blend <= 0.0)
    if count > 2:
        turn = np.einsum("ij,ij->i", leg[:-1], leg[1:]) / (length[:-1] * length[1:])
        stop[1:-1] |= 1.0 + turn < REVERSAL_COSINE
    tool_speed = request.tool_speed[np.diff(node) > 0]
    pace = _pace(q, stop, tool_speed, tool_position, speed) if count > 1 else np.zeros(0)
    share_in, share_out = np.zeros(count), np.zeros(count)
    corner = np.flatnonzero(~stop)
    if len(corner):
        away = np.concatenate([-leg[corner - 1], leg[corner]])
        share = _find_crossing(np.tile(q[corner], (2, 1)), 0.5 * away, np.tile(blend[corner], 2), tool_position)
        part = 0.5 * share.reshape(2, -1)
        cut = part.min(axis=0) > 0.0  # a radius finer than the search for its crossing is none
        stop[corner[~cut]] = True
        corner, (part_in, part_out) = corner[cut], part[:, cut]
        time_in, time_out = part_in * length[corner - 1] / pace[corner - 1], part_out * length[corner] / pace[corner]
        share_in[corner] = part_in * np.minimum(1.0, PACE_RATIO * time_out / time_in)
        share_out[corner] = part_out * np.minimum(1.0, PACE_RATIO * time_in / time_out)
    entry, leave = q.copy(), q.copy()
    entry[1:] -= share_in[1:, None] * leg
    leave[:-1] += share_out[:-1, None] * leg
    parts = (read_only(part) for part in (entry, leave, share_in, share_out, pace))
    return Corners(read_only(q), node, stop, *parts)


def corner_ends(q: Array, corner: Index, radius: Array, tool_position: ToolPosition) -> tuple[Array, Array]:
    """Return where cutting corners begins and ends, (k, N) [rad] both: on either leg the tool point is ``radius`` away.

    Args:
        q: path points (m, N) [rad], each other than the one before.
        corner: the points that are cut, (k,), neither the first nor the last.
        radius: of each (k,) [m]; half a leg is cut at most.
        tool_position: of the tool point.
    """
    halves = 0.5 * np.concatenate([q[corner - 1] - q[corner], q[corner + 1] - q[corner]])
    if not len(corner):
        return halves, halves
    share = _find_crossing(np.tile(q[corner], (2, 1)), halves, np.tile(radius, 2), tool_position)
    entry, leave = np.split(np.tile(q[corner], (2, 1)) + share[:, None] * halves, 2)
    return entry, leave


def _pace(q: Array, stop: Mask, tool_speed: Array, tool_position: ToolPosition, speed: Array) -> Array:
    """Return the joint-space speed (M-1,) [rad/s] on each leg that the joints and the tool's limit allow on average.

    Between two stops the lowest limit of the tool counts for all legs: such a pace changes little from leg to leg, and
    what a leg may do beyond it is left to the profile.
    """
    samples = 9  # of the tool point along each leg
    leg = np.diff(q, axis=0)
    share = np.linspace(0.0, 1.0, samples)
    rows = q[:-1, None, :] + share[:, None] * leg[:, None, :]
    x = tool_position(rows.reshape(-1, q.shape[1])).reshape(len(leg), samples, 3)
    travel = np.linalg.norm(np.diff(x, axis=1), axis=2).sum(axis=1)
    slowest = np.minimum.reduceat(tool_speed, np.flatnonzero(stop[:-1]))[np.cumsum(stop[:-1]) - 1]
    needs = np.maximum(travel / slowest, (np.abs(leg) / speed).max(axis=1))
    return np.asarray(np.linalg.norm(leg, axis=1) / needs)


def _find_crossing(q: Array, half: Array, radius: Array, tool_position: ToolPosition) -> Array:
    """Return the first share (n,) in (0, 1] of ``half`` at which the tool point has come ``radius`` away."""
    grid = 32  # samples of half a leg that bracket the first crossing of the radius
    x_corner = tool_position(q)
    share = np.linspace(0.0, 1.0, grid + 1)
    rows = (q[:, None, :] + share[:, None] * half[:, None, :]).reshape(-1, q.shape[1])
    away = np.linalg.norm(tool_position(rows).reshape(len(q), -1, 3) - x_corner[:, None, :], axis=2)
    beyond = away >= radius[:, None]
    found = beyond.any(axis=1)
    high = np.where(found, share[np.argmax(beyond, axis=1)], 1.0)
    low = np.where(found, high - 1.0 / grid, 1.0)
    for _ in range(26 if found.any() else 0):  # 1 / (32 · 2^26): 5e-10 of half a leg
        middle = 0.5 * (low + high)
        far = np.linalg.norm(tool_position(q + middle[:, None] * half) - x_corner, axis=1) >= radius
        low, high = np.where(far, low, middle), np.where(far, middle, high)
    return np.where(found, low, 1.0)


def smoothstep(x: Array) -> tuple[Array, Array, Array, Array]:
    """Return ∫β, β, β′ and β″ of the quintic smoothstep at x in [0, 1]."""
    y = 1.0 - x
    area = x**4 * (2.5 + x * (x - 3.0))
    return area, x**3 * (10.0 + x * (6.0 * x - 15.0)), 30.0 * (x * y) ** 2, 60.0 * x * y * (y - x)


@dataclass(frozen=True)
class PathCurve:
    """q(s) as K pieces; s is about the tool point's travel [m].

    start, span (K,) [m]; centre, inward, outward (K, N) [rad]; rate_in, rate_out (K,) dσ/ds at either end [1/m];
    point (K,) the distinct path point that a blend rounds or a straight leads to; blend (K,) which of both it is.
    """

    start: Array
    span: Array
    centre: Array
    inward: Array
    outward: Array
    rate_in: Array
    rate_out: Array
    point: Index
    blend: Mask

    @property
    def length(self) -> float:
        """Arc length of the whole path."""
        return float(self.start[-1] + self.span[-1]) if len(self.start) else 0.0

    def piece(self, s: Array) -> Index:
        """Return the piece (n,) that each s lies in; a joint between two belongs to the later."""
        return np.clip(np.searchsorted(self.start, s, side="right") - 1, 0, len(self.start) - 1)

    def last_piece(self, s: Array) -> Index:
        """Return the piece (n,) on which each s is come to; a joint between two belongs to the earlier."""
        return np.clip(np.searchsorted(self.start, s, side="left") - 1, 0, None)

    def derivatives(self, s: Array, piece: Index | None = None) -> tuple[Array, Array, Array, Array]:
        """Return q [rad], dq/ds, d²q/ds² and d³q/ds³, (n, N) each, at s (n,), on these pieces (n,) or those of s."""
        k = self.piece(s) if piece is None else piece
        q, (sigma, sigma1, sigma2, sigma3) = self._travel(s, k)
        _, beta, beta1, beta2 = smoothstep(sigma)
        back = self.inward[k]
        swing = self.outward[k] - back
        tangent = back + beta[:, None] * swing
        d1 = (2.0 * sigma1)[:, None] * tangent
        d2 = (2.0 * sigma2)[:, None] * tangent + (2.0 * beta1 * sigma1**2)[:, None] * swing
        jerk = 2.0 * (beta2 * sigma1**3 + 3.0 * beta1 * sigma1 * sigma2)
        d3 = (2.0 * sigma3)[:, None] * tangent + jerk[:, None] * swing
        return q, d1, d2, d3

    def points(self, s: Array, piece: Index) -> Array:
        """Return q [rad] alone, (n, N), of what :meth:`derivatives` returns."""
        return self._travel(s, piece)[0]

    def _travel(self, s: Array, k: Index) -> tuple[Array, tuple[Array, Array, Array, Array]]:
        """Return q (n, N) [rad] at s (n,) on the pieces k (n,), and what each piece is through, σ and dσ/ds …, (n,)."""
        span, first = self.span[k], self.rate_in[k]
        gain = self.rate_out[k] - first
        tau = np.clip((s - self.start[k]) / span, 0.0, 1.0)
        area, step, step1, step2 = smoothstep(tau)
        sigma = np.clip(span * (first * tau + gain * area), 0.0, 1.0)
        there, left = (2.0 * smoothstep(x)[0] for x in (sigma, 1.0 - sigma))
        q = self.centre[k] + there[:, None] * self.outward[k] - left[:, None] * self.inward[k]
        return q, (sigma, first + gain * step, gain * step1 / span, gain * step2 / span**2)


def build_curve(corners: Corners) -> PathCurve:
    """String the straights and the blends of the corners together."""
    q, leg = corners.q, np.diff(corners.q, axis=0)
    if len(q) < 2:  # nothing moves
        still, one = read_only(np.zeros_like(q)), read_only(np.ones(1))
        return PathCurve(read_only(one - 1.0), one, q, still, still, one, one, np.zeros(1, np.intp), np.zeros(1, bool))
    left = 1.0 - corners.share_out[:-1] - corners.share_in[1:]
    half = 0.5 * left[:, None] * leg  # of the straights, one a leg
    straight = left > 1e-12  # of its leg: a shorter straight is left out, the blends share the whole leg
    blended = ~corners.stop
    # straight of leg k sorts as 2k, blend of point k as 2k − 1
    order = np.concatenate([2 * np.flatnonzero(straight), 2 * np.flatnonzero(blended) - 1])
    sort = np.argsort(order)
    into = np.flatnonzero(blended) - 1
    centre = np.concatenate([(corners.exit[:-1] + half)[straight], q[blended]])[sort]
    inward = np.concatenate([half[straight], corners.share_in[blended, None] * leg[into]])[sort]
    outward = np.concatenate([half[straight], corners.share_out[blended, None] * leg[into + 1]])[sort]
    blend = order[sort] % 2 == 1
    leg_in = order[sort] // 2
    rate_in = corners.pace[leg_in] / (2.0 * np.linalg.norm(inward, axis=1))
    rate_out = corners.pace[leg_in + blend] / (2.0 * np.linalg.norm(outward, axis=1))
    rate_out = np.where(blend, rate_out, rate_in)
    span = 2.0 / (rate_in + rate_out)
    start = np.concatenate([[0.0], np.cumsum(span)[:-1]])
    start, span, centre, inward, outward = (read_only(part) for part in (start, span, centre, inward, outward))
    return PathCurve(start, span, centre, inward, outward, read_only(rate_in), read_only(rate_out), leg_in + 1, blend)


def closest_passages(curve: PathCurve, count: int) -> Array:
    """Return the s (count,) at which the curve is nearest, in joint space, to each of its distinct path points."""
    grid = 64  # samples of a blend that bracket the passage
    end = curve.start + curve.span
    nearest = np.zeros(count)
    nearest[curve.point[~curve.blend]] = end[~curve.blend]  # stops; what is blended follows
    k = np.flatnonzero(curve.blend)
    if len(k) == 0:
        return nearest
    step = curve.span[k] / grid
    s = curve.start[k, None] + step[:, None] * np.arange(grid + 1)
    corner = np.repeat(curve.centre[k], grid + 1, axis=0)
    away = np.linalg.norm(curve.derivatives(s.ravel())[0] - corner, axis=1).reshape(s.shape)
    best = np.clip(np.argmin(away, axis=1), 1, grid - 1)
    low, high = curve.start[k] + (best - 1) * step, curve.start[k] + (best + 1) * step
    # 40: bisections: to 1e-12 of the step
    for _ in range(40):  # the distance falls where (q − corner)·q′ < 0
        middle = 0.5 * (low + high)
        point, tangent, _, _ = curve.derivatives(middle)
        falling = np.einsum("ij,ij->i", point - curve.centre[k], tangent) < 0.0
        low, high = np.where(falling, middle, low), np.where(falling, high, middle)
    nearest[curve.point[k]] = 0.5 * (low + high)
    return nearest
