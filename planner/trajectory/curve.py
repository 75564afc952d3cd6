"""The path as driven, q(s): straights and corners of one kind, three times continuously differentiable throughout.

A piece moves from centre − D_in to centre + D_out while its direction swings from D_in to D_out by the quintic
smoothstep β(σ) = 6σ⁵ − 15σ⁴ + 10σ³:  q_σ = 2((1 − β) D_in + β D_out). A straight is a corner that does not turn
(D_in = D_out). As a Bézier curve of degree 7 its points P0…P3 lie equally spaced on the incoming leg, P4…P7 on the
outgoing one, P3 and P4 a seventh of the way out from the corner. With B(σ) = ∫β the curve is
centre − 2B(1 − σ) D_in + 2B(σ) D_out, and 2B(1 − σ) + 2B(σ) ≤ 1, both ≥ 0: a convex combination of entry, corner and
exit, so it cannot leave their triangle. σ runs with s by the same smoothstep, from the pace of one leg to that of the
other, with zero second and third derivative at both ends: so q(s) is C³ from piece to piece.
"""

from dataclasses import dataclass

import numpy as np

from planner.trajectory.corner import Corners
from planner.trajectory.limits import Index, Mask
from planner.units import Array, frozen

PASSAGE_GRID = 64
PASSAGE_BISECTIONS = 40
SHORT = 1e-12  # a straight shorter than this part of its leg is left out: the blends share the whole leg


def smoothstep(x: Array) -> tuple[Array, Array, Array, Array]:
    """Return ∫β, β, β′ and β″ of the quintic smoothstep at x in [0, 1]."""
    y = 1.0 - x
    area = x**4 * (2.5 + x * (x - 3.0))
    return area, x**3 * (10.0 + x * (6.0 * x - 15.0)), 30.0 * (x * y) ** 2, 60.0 * x * y * (y - x)


@dataclass(frozen=True)
class Curve:
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
        """The last s."""
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
        span, first = self.span[k], self.rate_in[k]
        gain = self.rate_out[k] - first
        tau = np.clip((s - self.start[k]) / span, 0.0, 1.0)
        area, step, step1, step2 = smoothstep(tau)
        sigma = np.clip(span * (first * tau + gain * area), 0.0, 1.0)
        sigma1, sigma2, sigma3 = first + gain * step, gain * step1 / span, gain * step2 / span**2
        area, beta, beta1, beta2 = smoothstep(sigma)
        back, forth = self.inward[k], self.outward[k]
        q = self.centre[k] + (2.0 * area)[:, None] * forth - (2.0 * smoothstep(1.0 - sigma)[0])[:, None] * back
        swing = forth - back
        tangent = back + beta[:, None] * swing
        d1 = (2.0 * sigma1)[:, None] * tangent
        d2 = (2.0 * sigma2)[:, None] * tangent + (2.0 * beta1 * sigma1**2)[:, None] * swing
        jerk = 2.0 * (beta2 * sigma1**3 + 3.0 * beta1 * sigma1 * sigma2)
        d3 = (2.0 * sigma3)[:, None] * tangent + jerk[:, None] * swing
        return q, d1, d2, d3


def build_curve(corners: Corners) -> Curve:
    """String the straights and the blends of the corners together."""
    q, leg = corners.q, np.diff(corners.q, axis=0)
    if len(q) < 2:  # nothing moves
        still, one = frozen(np.zeros_like(q)), frozen(np.ones(1))
        return Curve(frozen(one - 1.0), one, q, still, still, one, one, np.zeros(1, np.intp), np.zeros(1, bool))
    left = 1.0 - corners.share_out[:-1] - corners.share_in[1:]
    half = 0.5 * left[:, None] * leg  # of the straights, one a leg
    straight = left > SHORT
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
    start, span, centre, inward, outward = (frozen(part) for part in (start, span, centre, inward, outward))
    return Curve(start, span, centre, inward, outward, frozen(rate_in), frozen(rate_out), leg_in + 1, blend)


def closest_passages(curve: Curve, count: int) -> Array:
    """Return the s (count,) at which the curve is nearest, in joint space, to each of its distinct path points."""
    end = curve.start + curve.span
    nearest = np.zeros(count)
    nearest[curve.point[~curve.blend]] = end[~curve.blend]  # stops; what is blended follows
    k = np.flatnonzero(curve.blend)
    if len(k) == 0:
        return nearest
    step = curve.span[k] / PASSAGE_GRID
    s = curve.start[k, None] + step[:, None] * np.arange(PASSAGE_GRID + 1)
    corner = np.repeat(curve.centre[k], PASSAGE_GRID + 1, axis=0)
    away = np.linalg.norm(curve.derivatives(s.ravel())[0] - corner, axis=1).reshape(s.shape)
    best = np.clip(np.argmin(away, axis=1), 1, PASSAGE_GRID - 1)
    low, high = curve.start[k] + (best - 1) * step, curve.start[k] + (best + 1) * step
    for _ in range(PASSAGE_BISECTIONS):  # the distance falls where (q − corner)·q′ < 0
        middle = 0.5 * (low + high)
        point, tangent, _, _ = curve.derivatives(middle)
        falling = np.einsum("ij,ij->i", point - curve.centre[k], tangent) < 0.0
        low, high = np.where(falling, middle, low), np.where(falling, high, middle)
    nearest[curve.point[k]] = 0.5 * (low + high)
    return nearest
