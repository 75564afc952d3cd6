"""Millimetres and degrees live at the border, metres and radians inside: the only place that converts.

Arrays with one entry a row: some of the rows, the rows of several, means by group.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from planner.common.errors import did_you_mean

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

MM = 1e-3  # [m]
UM = 1e-6  # [m]
DEG = np.pi / 180.0  # [rad]
TURN = 2.0 * np.pi  # [rad]
QUARTER_TURN = np.pi / 2.0  # [rad]
URAD = 1e-6  # [rad]
MDEG = DEG * 1e-3  # [rad]
MM_PER_MIN = 1e-3 / 60.0  # [m/s]
SCALES = {"_mm": MM, "_um": UM, "_deg": DEG}  # by the end of a key
# beside the SI units themselves
SCALED_UNITS = {"mm": ("m", MM), "um": ("m", UM), "deg": ("rad", DEG), "urad": ("rad", 1e-6)}
PLAIN_UNITS = ("m", "rad", "s", "kg", "N", "Nm", "degC", "K", "turn", "1")


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


def round_finite(value: float, digits: int = 4) -> float | None:
    """Round to so many significant digits; ``None`` for what is not finite."""
    return float(f"{value:.{digits}g}") if np.isfinite(value) else None


def round_significant_digits(values: ArrayLike, digits: int) -> Array:
    """Round each value to so many significant digits."""
    return np.asarray(np.vectorize(lambda v: float(f"{v:.{digits}g}") + 0.0, otypes=[float])(values))


def in_units(decimals: int, **values: ArrayLike | None) -> dict[str, object]:
    """Return SI values by their keys in the unit that each key ends in, rounded; ``None`` where there is no number."""
    return {key: _round_to_unit(value, SCALES[key[key.rindex("_") :]], decimals) for key, value in values.items()}


def _round_to_unit(value: ArrayLike | None, scale: float, decimals: int) -> object:
    if value is None:
        return None
    if np.ndim(value):
        return [_round_to_unit(v, scale, decimals) for v in np.asarray(value)]
    number = float(np.asarray(value))
    return None if np.isnan(number) else round(number / scale, decimals) + 0.0


@lru_cache(256)
def si_unit(unit: str) -> tuple[str, float]:
    """Return the SI unit of a unit such as ``urad/Nm``, and the factor to it: ``rad/Nm``, 1e-6.

    Raises:
        ValueError: a part of it is no unit that is known here.
    """
    first, rest = _split(unit)
    known = [*PLAIN_UNITS, *SCALED_UNITS]
    for word, allowed in [(first, known), *((w, list(PLAIN_UNITS)) for w in re.split("[/·]", rest)[1:])]:
        if word not in allowed:
            raise ValueError(f"'{word}' is no unit{did_you_mean(word, allowed)} (allowed: {', '.join(allowed)})")
    word, factor = SCALED_UNITS.get(first, (first, 1.0))
    return word + rest, factor


def file_unit(unit: str) -> str:
    """Return the unit in which files give a value of the SI ``unit``: mm and deg, but um and urad per something."""
    first, rest = _split(unit)
    shown = {"m": "um", "rad": "urad"} if rest else {"m": "mm", "rad": "deg"}
    return shown.get(first, first) + rest


def display_unit(unit: str, size: float) -> tuple[str, float]:
    """Return how an effect's value of the SI ``unit`` and of about this ``size`` is written, and the factor to it."""
    first, rest = _split(unit)
    if unit == "s":
        return ("s", 1.0) if abs(size) >= 1.0 else ("ms", 1e3)  # [s] from here on a time is written in seconds
    if unit == "1" and abs(size) >= 0.005:  # from here on a part of one is written in per cent
        return "%", 100.0
    if unit == "1/turn":
        return "a turn", 1.0
    if first == "1" or unit == "rad/rad":
        return "ppm" + rest.removeprefix("/rad"), 1e6
    if first in ("m", "rad"):
        return (f"µ{first}/h", 1e6 * 3600.0) if rest == "/s" else (f"µ{unit}", 1e6)  # seconds in an hour
    return unit, 1.0


def format_value(value: float, std: float | None, unit: str, factor: float) -> str:
    """``182 ± 6 µrad``: the uncertainty to two digits at most, the value no finer than that."""
    value *= factor
    if std is None or not np.isfinite(std) or std <= 0:
        return f"{value:.3g} {unit}".strip()
    std *= factor
    if std < 1e-8:
        return f"{value:.3g} ± {std:.2g} {unit}".strip()
    digits = 0 if std >= 3 else int(max(1 - np.floor(np.log10(std)), 0))
    return f"{value:.{digits}f} ± {std:.{digits}f} {unit}".strip()


def _split(unit: str) -> tuple[str, str]:
    first = re.split("[/·]", unit)[0]
    return first, unit[len(first) :]


PLAN_DECIMALS = 9  # of degrees and millimetres in plan.json


def round_angles(angles: Array) -> Array:
    """Round angles [rad] to what ``plan.json`` keeps of them, so that reading it back gives the same bits."""
    return read_only(np.deg2rad(np.round(np.rad2deg(angles), PLAN_DECIMALS)))


CACHED_ROWS = 4096  # [samples] of one pass over a batch: what they need stays in the processor's cache


@dataclass(frozen=True)
class Rows:
    """Arrays of equal length, the fields of a dataclass; ``None`` where there is nothing."""

    def take(self, which: slice | np.ndarray) -> Self:
        """Return the rows at ``which`` (a slice, indices, or a mask); fields that are one array stay one."""
        own = {f.name: v for f in fields(self) if (v := getattr(self, f.name)) is not None}
        taken = {key: v[which] for key, v in {id(v): v for v in own.values()}.items()}
        return replace(self, **{name: taken[id(v)] for name, v in own.items()})

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Return the rows of all, one after the other, in the fields that all of them have."""
        columns = {f.name: [getattr(p, f.name) for p in parts] for f in fields(cls)}
        return cls(**{name: np.concatenate(v) for name, v in columns.items() if not any(part is None for part in v)})


def mirror_lower(matrix: Array) -> Array:
    """Make a square matrix symmetric, in place, by its lower triangle; return it."""
    step = 256  # rows at once, so that no second matrix is made
    for start in range(0, len(matrix), step):
        end = min(start + step, len(matrix))
        own = matrix[start:end, start:end]
        own[:] = np.where(np.tri(len(own), dtype=bool), own, own.T)
        matrix[start:end, end:] = matrix[end:, start:end].T
    return matrix


def mean_by_group(values: Array, group: np.ndarray) -> Array:
    """Return the mean of values (n,) or (n, k) in each group 0 … G − 1, (G,) or (G, k); NaN where a group has none."""
    count = np.bincount(group)
    sums = np.stack([np.bincount(group, column) for column in np.atleast_2d(values.T)], axis=1)
    with np.errstate(invalid="ignore"):
        return np.asarray(sums / count[:, None]).reshape(-1, *values.shape[1:])
