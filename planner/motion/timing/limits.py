"""Joint and tool limits, the checked request, and axis percentages for point-to-point moves."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planner.common.errors import InputError
from planner.common.units import Array, read_only
from planner.motion.tolerances import NO_JERK_LIMIT, STRAIGHT_SPEED_RATIO

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
        fraction = np.where(peak > 0.0, tool_speed * quickest / peak, 1.0)
    return np.asarray(100.0 * np.minimum(fraction, 1.0))
