"""Millimetres and degrees live at the border, metres and radians inside: the only place that converts."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

Array = NDArray[np.float64]

MM = 1e-3  # [m]
UM = 1e-6  # [m]
DEG = np.pi / 180.0  # [rad]
MM_PER_MIN = 1e-3 / 60.0  # [m/s]
SCALES = {"_mm": MM, "_um": UM, "_deg": DEG}  # by the end of a key


def from_mm(value: ArrayLike) -> Array:
    """Convert millimetres to metres."""
    return np.asarray(value, dtype=float) * MM


def to_mm(value: ArrayLike) -> Array:
    """Convert metres to millimetres."""
    return np.asarray(value, dtype=float) / MM


def from_deg(value: ArrayLike) -> Array:
    """Convert degrees to radians."""
    return np.asarray(value, dtype=float) * DEG


def to_deg(value: ArrayLike) -> Array:
    """Convert radians to degrees."""
    return np.asarray(value, dtype=float) / DEG


def read_only(value: ArrayLike, dtype: DTypeLike = float) -> NDArray[Any]:
    """Return a read-only array: what flows between rooms is never changed in place."""
    array = np.array(value, dtype=dtype)
    array.setflags(write=False)
    return array


def in_units(decimals: int, **values: ArrayLike | None) -> dict[str, object]:
    """Return SI values by their keys in the unit that each key ends in, rounded; ``None`` where there is no number."""
    return {key: _rounded(value, SCALES[key[key.rindex("_") :]], decimals) for key, value in values.items()}


def _rounded(value: ArrayLike | None, scale: float, decimals: int) -> object:
    if value is None:
        return None
    if np.ndim(value):
        return [_rounded(v, scale, decimals) for v in np.asarray(value)]
    number = float(np.asarray(value))
    return None if np.isnan(number) else round(number / scale, decimals) + 0.0
