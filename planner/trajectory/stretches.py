"""The path cut into stretches, each with bounds on q′, q″, q‴ and the tool's limit: what the profile may do on it.

A new stretch begins wherever the speed limit along the path has changed by a few percent, so the varying tool-point
speed of a straight joint leg costs little, and a leg without it stays one stretch.
"""

from dataclasses import dataclass

import numpy as np

from planner.trajectory.curve import Curve
from planner.trajectory.limits import Index, Limits, Mask, ToolJacobian
from planner.units import Array, frozen

JOINT_STEP = 0.015  # [rad] largest joint travel between two samples of the tool's speed
HALF_BLEND = 24  # intervals in either half of a blend
CHANGE = 0.03  # relative change of the speed limit that begins a new stretch
MARGIN_STRAIGHT = 1.0 + 2e-4  # what a maximum between two samples may exceed the samples by
MARGIN_BLEND = 1.0 + 1e-2
SAGITTA = 0.2  # 1/8 for a constant second derivative, and room for one that varies
JUMP = 1e-6  # a relative change from one interval to the next that only a stop can make
SHARE = 0.9  # of the acceleration and jerk limits that curvature alone may use


@dataclass(frozen=True)
class Stretches:
    """S stretches in order along the path.

    edge (S+1,) their ends in s [m]; d1, d2, d3 (S, N) the largest |dq/ds|, |d²q/ds²|, |d³q/ds³| on each; tool (S,) the
    largest ds/dt [m/s] that the tool's speed limit allows; rest (S+1,) ends at which the motion stands still.
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


def cut(
    curve: Curve, passage: Array, stop: Mask, tool_speed: Array, jacobian: ToolJacobian, limits: Limits
) -> Stretches:
    """Cut the curve into stretches.

    passage (M,) [m] and stop (M,) per distinct path point, tool_speed (M-1,) [m/s] per leg.
    """
    s, piece, leg = _samples(curve, passage, tool_speed)
    # at a stop the tangent jumps: each interval takes both its ends on its own piece
    low, high = curve.derivatives(s[:-1], piece), curve.derivatives(s[1:], piece)
    margin = np.where(curve.blend[piece], MARGIN_BLEND, MARGIN_STRAIGHT)[:, None]
    d1, d2, d3 = (np.maximum(np.abs(a), np.abs(b)) * margin for a, b in zip(low[1:], high[1:], strict=True))
    tool = np.full(len(leg), np.inf)
    if np.isfinite(tool_speed).any():
        jacobians = jacobian(np.concatenate([low[0], high[0][-1:]]))
        begin = np.einsum("nij,nj->ni", jacobians[:-1], low[1])
        end = np.einsum("nij,nj->ni", jacobians[1:], high[1])
        with np.errstate(divide="ignore"):
            tool = tool_speed[leg] / (_most(begin, end, np.diff(s)) * MARGIN_STRAIGHT)
    fastest = speed_bound(d1, d2, d3, tool, limits, SHARE)
    marks = np.searchsorted(s, np.concatenate([curve.start, passage]))
    first = _first_intervals(fastest, marks[marks < len(fastest)])
    edge = np.concatenate([s[first], s[-1:]])
    rest = np.zeros(len(edge), dtype=bool)
    rest[np.searchsorted(edge, passage[stop])] = True
    d1, d2, d3 = (frozen(np.maximum.reduceat(d, first)) for d in (d1, d2, d3))
    return Stretches(frozen(edge), d1, d2, d3, frozen(np.minimum.reduceat(tool, first)), rest)


def _samples(curve: Curve, passage: Array, tool_speed: Array) -> tuple[Array, Index, Index]:
    """Return sample places s (n+1,), and of the intervals between them the piece (n,) and the leg (n,)."""
    low = np.unique(np.concatenate([curve.start, passage[:-1]]))
    high = np.concatenate([low[1:], [passage[-1]]])
    piece = curve.piece(low)
    leg = np.clip(np.searchsorted(passage, low, side="right") - 1, 0, len(tool_speed) - 1)
    travel = np.abs(curve.derivatives(high, piece)[0] - curve.derivatives(low, piece)[0]).max(axis=1)
    count = np.where(np.isfinite(tool_speed[leg]), np.ceil(travel / JOINT_STEP), 1.0)
    count = np.maximum(count, np.where(curve.blend[piece], HALF_BLEND, 1)).astype(np.intp)
    run = np.repeat(np.arange(len(low)), count)
    within = np.arange(len(run)) - np.repeat(np.cumsum(count) - count, count)
    s = low[run] + (high - low)[run] * (within / count[run])
    return np.concatenate([s, high[-1:]]), piece[run], leg[run]


def _most(low: Array, high: Array, h: Array) -> Array:
    """Return the largest length (n,) of a vector on intervals h (n,), from its values (n, 3) at both their ends.

    Between two samples the vector leaves its chord by at most h²/8 of its second derivative, here taken from divided
    differences at both ends, and a chord is no longer than the longer of its ends.
    """
    slope = (high - low) / h[:, None]
    bend = np.zeros(len(h) + 1)
    bend[1:-1] = 2.0 * np.linalg.norm(np.diff(slope, axis=0), axis=1) / (h[:-1] + h[1:])
    bend[1:-1][np.linalg.norm(high[:-1] - low[1:], axis=1) > JUMP * np.linalg.norm(low[1:], axis=1)] = 0.0
    longest = np.maximum(np.linalg.norm(low, axis=1), np.linalg.norm(high, axis=1))
    return np.asarray(longest + SAGITTA * h**2 * np.maximum(bend[:-1], bend[1:]))


def _first_intervals(fastest: Array, marks: Index) -> Index:
    """Return the first interval of each stretch: at every mark, and wherever the limit has drifted by CHANGE."""
    drift = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(np.log(fastest))))])
    begins = np.zeros(len(fastest), dtype=bool)
    begins[marks] = True
    begins[1:] |= np.diff(np.floor(drift / CHANGE)) > 0
    return np.flatnonzero(begins)
