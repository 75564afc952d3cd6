"""Which reading a table holds: a length, a position, or the socket that the point sits in."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from planner.errors import InputError
from planner.run.columns import spellings
from planner.run.table import Table
from planner.run.types import IntArray, Readings
from planner.units import Array, frozen

POSITION = ("x", "y", "z")
TURNING = ("rx", "ry", "rz")
OFFSET = ("dx", "dy", "dz")
KINDS = {"length": "length_mm", "x": "x_mm, y_mm, z_mm", "ball": "ball"}


def kind_of(readings: Readings) -> str:
    """Return ``"length"``, ``"position"`` or ``"ball"``."""
    if readings.length is not None:
        return "length"
    return "position" if readings.position is not None else "ball"


def has_reading(table: Table) -> bool:
    """Return whether a table holds any part of a reading."""
    return any(table.has(key) for key in ("length", *POSITION, "ball"))


def readings_of(table: Table) -> tuple[Readings, tuple[str, ...]]:
    """Return what the gauge read, and the names of the sockets.

    Raises:
        InputError: no reading, several kinds of it, or a part of one.
    """
    file = table.source.file
    position, turning, offset = (_triple(table, keys) for keys in (POSITION, TURNING, OFFSET))
    found = [
        name
        for name, key in ((KINDS["length"], "length"), (KINDS["x"], "x"), (KINDS["ball"], "ball"))
        if table.has(key)
    ]
    if not found:
        raise InputError(
            f"{file}: there is no reading; one of {'; '.join(KINDS.values())} is needed beside the joint angles"
        )
    if len(found) > 1:
        raise InputError(
            f"{file}: there are several readings ({'; '.join(found)}), but a run has one; give each its own file"
        )
    if turning is not None and position is None:
        raise InputError(f"{file}: rx, ry, rz turn with a position, but there is no {KINDS['x']}")
    if offset is not None and not table.has("ball"):
        raise InputError(f"{file}: dx, dy, dz are from a ball's centre, but there is no column ball")
    if table.has("ball"):
        index, names = indexed(table.frame["ball"].to_list())
        return Readings(ball=index, offset=offset), names
    if position is not None:
        rotation = None if turning is None else frozen(Rotation.from_euler("XYZ", turning).as_matrix())
        return Readings(position=position, rotation=rotation), ()
    return Readings(length=frozen(table.array("length"))), ()


def _triple(table: Table, keys: Sequence[str]) -> Array | None:
    """Return three columns (n, 3) or ``None``; two of them are an error."""
    missing = [key for key in keys if not table.has(key)]
    if len(missing) == len(keys):
        return None
    if missing:
        raise InputError(
            f"{table.source.file}: there is no column {', '.join(spellings(k) for k in missing)} beside the others"
        )
    return frozen(table.arrays(keys))


def indexed(values: Sequence[str]) -> tuple[IntArray, tuple[str, ...]]:
    """Return the index of each name (n,) in the sorted names (numbers by value), and these."""
    names = sorted_names(set(values))
    place = {name: i for i, name in enumerate(names)}
    index = np.fromiter((place[v] for v in values), dtype=np.int64, count=len(values))
    index.setflags(write=False)
    return index, names


def sorted_names(names: set[str]) -> tuple[str, ...]:
    """Return names in an order of their own: whole numbers by value, then the others by letters."""
    return tuple(sorted(names, key=lambda n: (0, int(n), n) if n.lstrip("-").isdecimal() else (1, 0, n)))
