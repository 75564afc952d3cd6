"""The same bytes on any machine: one BLAS thread where a number decides, and ties that rounding cannot break."""

from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from planner.common.units import Array

Positions = NDArray[np.intp]
"""Positions of candidates in a pool."""

_P = ParamSpec("_P")
_R = TypeVar("_R")


@cache
def _controller() -> ThreadpoolController:
    return ThreadpoolController()


def on_one_thread(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Run ``function`` with linear algebra on one thread."""

    @wraps(function)
    def wrapper(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        """Call the function with one BLAS thread."""
        with _controller().limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return wrapper


def even_positions(n: int, most: int) -> Positions:
    """Positions of at most ``most`` of n things, evenly over all of them, ascending."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).astype(int))


def round_significant(values: Array) -> Array:
    """Round to 11 significant digits, so that rounding noise breaks no tie: ties then fall to the lower index."""
    values = np.asarray(values, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 10.0 ** (10 - np.floor(np.log10(np.abs(values))))
    known = np.isfinite(scale) & np.isfinite(values) & (values != 0)
    safe = np.where(known, scale, 1.0)
    return np.where(known, np.round(np.where(known, values, 0.0) * safe) / safe, values)


def first_maximum(values: Array) -> int:
    """Position of the largest value; of values equal to within rounding (1e-11) the first."""
    top = float(np.max(values))
    return int(np.argmax(values >= top - 1e-11 * abs(top))) if np.isfinite(top) else int(np.argmax(values))


def with_fixed_signs(axes: Array) -> Array:
    """Return axes (k, r) of which the first of the largest components is positive: libraries differ in their signs."""
    size = np.abs(axes)
    first = np.argmax(size > 0.99 * size.max(axis=0), axis=0)  # 0.99: of the largest, so that rounding decides nothing
    return np.asarray(axes * np.where(axes[first, np.arange(axes.shape[1])] < 0, -1.0, 1.0))
