"""What the joints and the tool may do, and how the caller's input is checked before anything is timed."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planner.errors import InputError
from planner.units import Array, frozen

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
            value = frozen(getattr(self, name))
            object.__setattr__(self, name, value)
            if value.ndim != 1 or len(value) != len(self.speed):
                raise InputError(
                    f"joint {name} limits have shape {value.shape}, allowed is one per joint, as many as speeds"
                )
            bad = ~(np.isfinite(value) & (value > 0.0))
            if bad.any():
                j = int(np.argmax(bad))
                raise InputError(f"joint {j + 1} has a {name} limit of {value[j]:g}, allowed is positive and finite")


@dataclass(frozen=True)
class Request:
    """A polyline to be driven, checked: path_q (m, N) [rad], stop (m,), blend_m (m,), tool_speed (m-1,), dwell (m,)."""

    path_q: Array
    stop: Mask
    blend_m: Array
    tool_speed: Array
    dwell: Array


def _spread(value: ArrayLike, count: int, name: str, unit: str, positive: bool) -> Array:
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


def checked(
    path_q: ArrayLike,
    stop: ArrayLike,
    blend_m: ArrayLike,
    tool_speed: ArrayLike,
    dwell: ArrayLike,
    n_joints: int | None = None,
) -> Request:
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
    radius = np.where(rest, 0.0, _spread(blend_m, m, "blend radius", "m", positive=False))
    wait = _spread(dwell, m, "dwell", "s", positive=False)
    if np.ndim(dwell) == 0:
        wait = np.where(rest, wait, 0.0)
    if (wait[~rest] > 0.0).any():
        i = int(np.argmax(~rest & (wait > 0.0)))
        raise InputError(f"path point {i} has a dwell of {wait[i]:g} s but is blended: make it a stop to dwell there")
    speed = _spread(tool_speed, m - 1, "tool speed", "m/s", positive=True)
    return Request(frozen(q), rest, frozen(radius), frozen(speed), frozen(wait))
