"""Readings of one number that is neither a length nor a position: a gauge brings the column that it has in a run."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, TypeVar

from planner.common.units import Array
from planner.runs.run import Readings


@dataclass(frozen=True)
class ScalarReadings(Readings):
    """One number a sample; the base of what a gauge registers with :func:`register_scalar`.

    Attributes:
        scalar: (n,) in SI units.
    """

    scalar: Array | None = None

    key: ClassVar[str]
    """Name of the column without its unit."""
    units: ClassVar[Mapping[str, float]]
    """Units that the column may be written in, with their factors to SI; it is written in the first."""
    plausible: ClassVar[tuple[float, float]]
    """Lowest and highest of any cell, in SI."""

    @property
    def columns(self) -> str:
        """Its column of a run."""
        return column_of(type(self))


S = TypeVar("S", bound=type[ScalarReadings])
_SCALARS: dict[str, type[ScalarReadings]] = {}


def register_scalar(kind: S) -> S:
    """Make a scalar reading known by its column; a class decorator.

    Raises:
        ValueError: another one has that column.
    """
    if kind.key in _SCALARS:
        raise ValueError(f"column '{kind.key}': {_SCALARS[kind.key].__module__} has registered it already")
    _SCALARS[kind.key] = kind
    return kind


def scalar_kinds() -> Mapping[str, type[ScalarReadings]]:
    """Return the scalar readings that are known, by their keys."""
    return _SCALARS


def column_of(kind: type[ScalarReadings]) -> str:
    """Return the column that a scalar reading is written in."""
    return f"{kind.key}_{next(iter(kind.units))}"
