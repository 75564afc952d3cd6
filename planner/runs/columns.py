"""What a column of a run is called: a quantity and, in the same name, its unit."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from planner.common.errors import InputError, did_you_mean
from planner.common.units import DEG, MM, UM

LENGTH = {"mm": MM, "m": 1.0, "um": UM}
ANGLE = {"deg": DEG, "rad": 1.0}
NO_UNIT: Mapping[str, float] = {}
PLAIN: Mapping[str, Mapping[str, float]] = {
    "t": {"s": 1.0},
    "length": LENGTH,
    **{axis: LENGTH for axis in ("x", "y", "z", "dx", "dy", "dz")},
    **{axis: ANGLE for axis in ("rx", "ry", "rz")},
    "temperature": {"degC": 1.0},
    "force": {"N": 1.0},
    "payload": {"kg": 1.0},
    **{name: NO_UNIT for name in ("session", "pose", "sync", "fixture", "ball", "point")},
}
OF_JOINTS: Mapping[str, Mapping[str, float]] = {"q": ANGLE, "cmd": ANGLE, "torque": {"Nm": 1.0}, "direction": NO_UNIT}
NAMES = frozenset({"fixture", "ball", "point"})  # columns that hold names, not numbers
PLAUSIBLE = {  # lowest and highest of any cell, in SI: beyond it a unit or a column is wrong
    "t": (-1e12, 1e12), "length": (0.0, 1e3), **dict.fromkeys(("x", "y", "z"), (-1e3, 1e3)),
    **dict.fromkeys(("dx", "dy", "dz"), (-1.0, 1.0)), **dict.fromkeys(("q", "cmd"), (-1e4, 1e4)),
    "temperature": (-100.0, 500.0), "force": (-1e6, 1e6), "payload": (0.0, 1e5), "torque": (-1e6, 1e6),
    "pose": (-1.0, 1e7), "session": (-1e7, 1e7),
}  # fmt: skip
WHOLE = frozenset({"session", "pose", "sync", "direction"})  # columns of whole numbers
_NUMBERED = re.compile(r"(?P<stem>q|cmd|torque|direction)(?P<joint>[1-9]\d*)")


@dataclass(frozen=True)
class RunColumn:
    """A column that a run may have.

    Attributes:
        header: as written, ``q1_deg``.
        key: the quantity, ``q1``.
        unit: ``deg``, or empty.
        factor: from the unit to SI.
    """

    header: str
    key: str
    unit: str
    factor: float

    @property
    def stem(self) -> str:
        """Return the quantity without the number of its joint."""
        return split_key(self.key)[0]


def split_key(key: str) -> tuple[str, int]:
    """Return a key's stem and joint: ``("q", 1)`` of ``q1``; joint 0 where the quantity is not of joints."""
    match = _NUMBERED.fullmatch(key)
    return (match["stem"], int(match["joint"])) if match else (key, 0)


def units_of(key: str) -> Mapping[str, float] | None:
    """Return the units that a quantity is written in, with their factors to SI; ``None`` where there is no such one."""
    stem, joint = split_key(key)
    return (OF_JOINTS if joint else PLAIN).get(stem)


def find_column(header: str) -> RunColumn | None:
    """Return the column that a header names exactly, else ``None``."""
    key, _, unit = header.partition("_")
    units = units_of(key)
    if units is None or (unit not in units if units else "_" in header):
        return None
    return RunColumn(header, key, unit, units.get(unit, 1.0))


def spellings(key: str) -> str:
    """Return how a quantity's column may be called: ``"q1_deg or q1_rad"``."""
    units = units_of(key)
    return " or ".join(f"{key}_{unit}" for unit in units) if units else key


def known_keys(n_joints: int) -> list[str]:
    """Return every quantity for an arm of ``n_joints``."""
    return [*PLAIN, *(f"{stem}{joint}" for stem in OF_JOINTS for joint in range(1, n_joints + 1))]


def known_headers(n_joints: int) -> list[str]:
    """Return every column's name for an arm of ``n_joints``."""
    return [name for key in known_keys(n_joints) for name in spellings(key).split(" or ")]


def recognise_columns(headers: Sequence[str], n_joints: int, file: str) -> tuple[dict[str, RunColumn], list[str]]:
    """Return the columns of a run among the headers, by header, and a warning for each other that is left out.

    Raises:
        InputError: a quantity with a wrong or missing unit, one column twice, or a joint that the arm does not have.
    """
    columns: dict[str, RunColumn] = {}
    found: dict[str, str] = {}
    for c in filter(None, map(find_column, headers)):
        if c.key in found:
            raise InputError(f"{file}: the columns '{found[c.key]}' and '{c.header}' say the same; keep one")
        if split_key(c.key)[1] > n_joints:
            raise InputError(f"{file}: there is a column '{c.header}', but the robot has {n_joints} joints")
        columns[c.header], found[c.key] = c, c.header
    meant, known = {key.lower(): key for key in known_keys(n_joints)}, known_headers(n_joints)
    warnings = []
    for header in (h for h in headers if h not in columns):
        key, _, rest = header.partition("_")
        key = meant.get(key.lower(), key)
        if units_of(key) is not None and key not in found and "_" not in rest:
            raise InputError(f"{file}: the column '{header}' does not say its unit; it is called {spellings(key)}")
        hint = did_you_mean(header, known)
        warnings.append(f"{Path(file).name}: the column '{header}' is not part of a run and was left out{hint}")
    return columns, warnings
