"""Joint and tool limits, the checked request, and axis percentages for point-to-point moves."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planner.common.errors import InputError
from planner.common.units import Array, read_only

Mask = NDArray[np.bool_]
Index = NDArray[np.intp]

ToolPosition = Callable[[Array], Array]
"""Joint angles (n, N) [rad] to tool points (n, 3) [m]."""

ToolJacobian = Callable[[Array], Array]
"""Joint angles (n, N) [rad] to d(tool point)/dq (n, 3, N) [m/rad]."""


@dataclass(frozen=True)
class Limits:
    """Joint limits of the motion: speed [rad/s], acceleration [rad/s²] and jerk [rad/s³], each (N,), all > 0.

    Raises InputError where a limit is not positive and finite, or the three differ in length.
    """

    speed: Array
    acceleration: Array
    jerk: Array

    def __post_init__(self) -> None:
        for name in ("speed", "acceleration", "jerk"):
            value = read_only(getattr(self, name))
            object.__setattr__(self, name, value)
            if value.ndim != 1 or len(value) != len(self.speed):
                raise InputError(
                    f"joint {name} limits have shape {value.shape}, allowed is one per joint, as many as speeds"
                )
            bad = ~(np.isfinite(value) & (value > 0.0))
            if bad.any():
                j = int(np.argmax(bad))
                raise InputError(f"joint {j + 1} has a {name} limit of {value[j]:g}, allowed is positive and finite")


NO_JERK_LIMIT = 1e9  # [m/s³] of a reading: nothing in a gauge is hurt by it


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

    def beside(self, limits: Limits) -> Limits:
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


def _full_length(value: ArrayLike, count: int, name: str, unit: str, positive: bool) -> Array:
    array = np.asarray(value, dtype=float)
    if array.ndim > 0 and array.shape != (count,):
        raise InputError(f"{name} has shape {array.shape}, allowed is one number or {count} of them")
    array = np.broadcast_to(array, (count,))
    low = ~(array > 0.0) if positive else ~((array >= 0.0) & np.isfinite(array))
    if low.any():
        found = array[int(np.argmax(low))]
        allowed = "positive" if positive else "zero or more, and finite"
        raise InputError(f"{name} holds {found:g} {unit}, allowed is {allowed}")
    return array


def check_request(
    path_q: ArrayLike,
    stop: ArrayLike,
    blend_m: ArrayLike,
    tool_speed: ArrayLike,
    dwell: ArrayLike,
    n_joints: int | None = None,
) -> TimingRequest:
    """Return the caller's polyline with every array at full length; the first and last point are always stops.

    Raises InputError on wrong shapes, NaN, negative radii or dwells, or a dwell where the tour does not rest.
    """
    q = np.asarray(path_q, dtype=float)
    if q.ndim != 2 or len(q) < 2 or q.shape[1] == 0 or not np.isfinite(q).all():
        raise InputError(f"a path of shape {q.shape} cannot be timed: it needs two or more finite joint poses")
    if n_joints is not None and q.shape[1] != n_joints:
        raise InputError(f"the path has {q.shape[1]} joints and the limits {n_joints}: they must agree")
    m = len(q)
    rest = np.array(stop, dtype=bool)
    if rest.shape != (m,):
        raise InputError(f"stop has shape {rest.shape}, allowed is one flag per path point, ({m},)")
    rest[[0, -1]] = True
    radius = np.where(rest, 0.0, _full_length(blend_m, m, "blend radius", "m", positive=False))
    wait = _full_length(dwell, m, "dwell", "s", positive=False)
    if np.ndim(dwell) == 0:
        wait = np.where(rest, wait, 0.0)
    if (wait[~rest] > 0.0).any():
        i = int(np.argmax(~rest & (wait > 0.0)))
        raise InputError(f"path point {i} has a dwell of {wait[i]:g} s but is blended: make it a stop to dwell there")
    speed = _full_length(tool_speed, m - 1, "tool speed", "m/s", positive=True)
    return TimingRequest(read_only(q), rest, read_only(radius), read_only(speed), read_only(wait))


PERCENT_STEP = 0.01  # [rad] between two samples of a leg
MARGIN = 1.0 + 2e-4  # what the tool's speed between two samples may exceed them by


def axis_percent(path_q: ArrayLike, *, tool_speed: ArrayLike, tool_jacobian: ToolJacobian, limits: Limits) -> Array:
    """Return for each leg (m-1,) the highest axis percentage, to 100, that keeps the tool point within tool_speed.

    A synchronised point-to-point move at fraction f takes T/f with T = max_j |Δq_j|/speed_j; its tool point moves at up
    to f · max_σ |J(q(σ)) Δq| / T. tool_speed is one or (m-1,) [m/s], inf for none. Raises InputError like
    plan_trajectory.
    """
    m = len(np.asarray(path_q))
    request = check_request(path_q, np.ones(m, dtype=bool), 0.0, tool_speed, 0.0, len(limits.speed))
    q, limit = request.path_q, request.tool_speed
    leg = np.diff(q, axis=0)
    quickest = (np.abs(leg) / limits.speed).max(axis=1)
    count = np.ceil(np.abs(leg).max(axis=1) / PERCENT_STEP).astype(np.intp) + 1
    run = np.repeat(np.arange(m - 1), count)
    begin = np.cumsum(count) - count
    share = (np.arange(len(run)) - begin[run]) / np.maximum(count - 1, 1)[run]
    jacobian = tool_jacobian(q[run] + share[:, None] * leg[run])
    travel = np.linalg.norm(np.einsum("nij,nj->ni", jacobian, leg[run]), axis=1)
    peak = np.maximum.reduceat(travel, begin) * MARGIN
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = np.where(peak > 0.0, limit * quickest / peak, 1.0)
    return read_only(100.0 * np.minimum(fraction, 1.0))
