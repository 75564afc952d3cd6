"""Columns of a run and their units, and a file as a table of them in SI, before it is known what was measured."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from planner.common.console import as_word
from planner.common.errors import InputError, did_you_mean
from planner.common.files import check_readable
from planner.common.lazy_modules import pl
from planner.common.units import DEG, MM, UM, Array, IntArray, read_only, to_deg
from planner.kinematics.angle_units import DEGREES, NOTE, find_small
from planner.kinematics.axes_line import KEY as AXES_OF
from planner.kinematics.axes_line import axes_line
from planner.runs.foreign_table import foreign_table
from planner.runs.run import index_names, scalar_kinds
from planner.runs.text import (
    NOTES,
    RowSource,
    check_finite,
    check_names,
    check_range,
    check_whole,
    drop_lost_positions,
    notes_in,
    parse_rows,
    read_lines,
    split_head,
)

# factors to SI of the units that a column may name
LENGTH = {"mm": MM, "m": 1.0, "um": UM}
ANGLE = {"deg": DEG, "rad": 1.0}  # to radians
TRAVEL = {
    "mm": DEG,
    "m": 1e3 * DEG,
}  # of a joint that slides: a millimetre counts as a degree does, see kinematics.robot
# of a probe's angles, with the convention that their columns may say (planner.runs.probe_turns)
TURN_UNITS = ANGLE | {f"{c}_{unit}": f for c in ("moving", "fixed", "vector") for unit, f in ANGLE.items()}
NO_UNIT: Mapping[str, float] = {}
# of columns that are there once
PLAIN: Mapping[str, Mapping[str, float]] = {
    "t": {"s": 1.0},
    "length": LENGTH,
    **{axis: LENGTH for axis in ("x", "y", "z", "dx", "dy", "dz")},
    **{axis: TURN_UNITS for axis in ("rx", "ry", "rz")},
    "temperature": {"degC": 1.0},
    "force": {"N": 1.0},
    "payload": {"kg": 1.0},
    **{name: {"px": 1.0} for name in ("u", "v")},
    **{name: NO_UNIT for name in ("session", "pose", "sync", "fixture", "ball", "point", "corner")},
    **{name: NO_UNIT for name in ("qw", "qx", "qy", "qz")},
}
OF_JOINTS: Mapping[str, Mapping[str, float]] = {
    "q": ANGLE | TRAVEL, "cmd": ANGLE | TRAVEL, "torque": {"Nm": 1.0, "N": 1.0}, "direction": NO_UNIT,
}  # fmt: skip
NAMES = frozenset({"fixture", "ball", "point"})  # columns that hold names, not numbers
PLAUSIBLE = {  # lowest and highest of any cell, in SI: beyond it a unit or a column is wrong
    "t": (-1e12, 1e12), "length": (0.0, 1e3), **dict.fromkeys(("x", "y", "z"), (-1e3, 1e3)),
    **dict.fromkeys(("dx", "dy", "dz"), (-1.0, 1.0)), **dict.fromkeys(("q", "cmd"), (-1e4, 1e4)),
    "temperature": (-100.0, 500.0), "force": (-1e6, 1e6), "payload": (0.0, 1e5), "torque": (-1e6, 1e6),
    "pose": (-1.0, 1e7), "session": (-1e7, 1e7),
    **dict.fromkeys(("u", "v"), (-1e5, 1e5)), "corner": (0.0, 1e4),
    **dict.fromkeys(("qw", "qx", "qy", "qz"), (-1.001, 1.001)),
}  # fmt: skip
WHOLE = frozenset({"session", "pose", "sync", "direction", "corner"})  # columns of whole numbers
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
    if joint:
        return OF_JOINTS.get(stem)
    return scalar_kinds()[stem].units if stem in scalar_kinds() else PLAIN.get(stem)


def find_column(header: str) -> RunColumn | None:
    """Return the column that a header names exactly, else ``None``."""
    key, _, unit = header.partition("_")
    units = units_of(key)
    if units is None or (unit not in units if units else "_" in header):
        return None
    return RunColumn(header, key, unit, units.get(unit, 1.0))


def spellings(key: str, convention: str = "") -> str:
    """Return how a quantity's column may be called: ``"q1_deg or q1_rad"``; a probe's angle in a convention alone."""
    units = [unit for unit in _usual_units(key) if _convention_of(unit) == convention]
    return " or ".join(f"{key}_{unit}" for unit in units) if units else key


def _usual_units(key: str) -> list[str]:
    """Return the units that a quantity's column may name; those of travel are read of a joint, and not proposed."""
    return [unit for unit in units_of(key) or () if unit not in TRAVEL or not split_key(key)[1]]


def _convention_of(unit: str) -> str:
    """Return the convention that a unit of a probe's angle says, empty where it says none."""
    return unit.rpartition("_")[0]


def known_keys(n_joints: int) -> list[str]:
    """Return every quantity for an arm of ``n_joints``."""
    return [*PLAIN, *scalar_kinds(), *(f"{stem}{joint}" for stem in OF_JOINTS for joint in range(1, n_joints + 1))]


def known_headers(n_joints: int) -> list[str]:
    """Return every column's name for an arm of ``n_joints``."""
    return [f"{key}_{unit}" if unit else key for key in known_keys(n_joints) for unit in _usual_units(key) or ("",)]


def recognise_columns(headers: Sequence[str], n_joints: int, file: str) -> tuple[dict[str, RunColumn], list[str]]:
    """Return the columns of a run among the headers, by header, and a warning for each other that is left out.

    Raises:
        InputError: a quantity with a wrong or missing unit, one column twice, or a joint that the arm does not have.
    """
    columns: dict[str, RunColumn] = {}
    found: dict[str, str] = {}
    known = known_headers(n_joints)
    plainly = {name.lower(): name for name in known}
    exact = {h for h in headers if find_column(h)}
    for c in filter(None, (find_in_any_case(h, plainly, exact) for h in headers)):
        if c.key in found:
            raise InputError(f"{file}: the columns '{found[c.key]}' and '{c.header}' say the same; keep one")
        if split_key(c.key)[1] > n_joints:
            raise InputError(f"{file}: there is a column '{c.header}', but the robot has {n_joints} joints")
        columns[c.header], found[c.key] = c, c.header
    meant = {key.lower(): key for key in known_keys(n_joints)}
    warnings = []
    for header in (h for h in headers if h not in columns):
        key, _, rest = header.partition("_")
        key = meant.get(key.lower(), key)
        if units_of(key) and key not in found and "_" not in rest:
            called = spellings(key, rest if f"{rest}_deg" in (units_of(key) or ()) else "")
            raise InputError(f"{file}: the column '{header}' does not say its unit; it is called {called}")
        hint = did_you_mean(header, known)
        warnings.append(f"{Path(file).name}: the column '{header}' is not part of a run and was left out{hint}")
    return columns, warnings


def find_in_any_case(header: str, known: Mapping[str, str], exact: Collection[str]) -> RunColumn | None:
    """Return the column that a header names, whatever the case of its letters: ``Pose`` is ``pose``.

    Args:
        header: as written.
        known: names of columns by their small letters.
        exact: headers that name a column to the letter; none is taken for the same one in other letters.
    """
    if (found := find_column(header)) is not None:
        return found
    name = known.get(header.lower())
    column = None if name is None or name in exact else find_column(name)
    return None if column is None else replace(column, header=header)


ALLOWED = {"direction": (-1, 0, 1), "sync": (0, 1)}  # values of columns that have few
MAY_BE_BLANK = frozenset({"pose"})  # between two poses there is none


@dataclass(frozen=True)
class RunTable:
    """Columns in SI units under the names of their quantities (``q1``, ``length``, ``t``).

    Attributes:
        source: where the rows came from.
        frame: Float64 or text, no blanks but in ``pose``.
        units: the unit that each column was written in, by quantity.
        notes: what the comment lines say, by name.
        warnings: what a person should know.
    """

    source: RowSource
    frame: pl.DataFrame
    units: Mapping[str, str] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def stem(self) -> str:
        """Return the file's name without its ending."""
        return Path(self.source.file).stem

    @property
    def slides(self) -> frozenset[int]:
        """Numbers, from 1, of the joints whose columns are lengths."""
        keys = (split_key(key) for key, unit in self.units.items() if unit in TRAVEL)
        return frozenset(joint for stem, joint in keys if stem in ("q", "cmd"))

    @property
    def n_joints(self) -> int:
        """Return the largest number of a joint that has an angle here, 0 where none has."""
        joints = (split_key(key) for key in self.frame.columns)
        return max((joint for stem, joint in joints if stem in ("q", "cmd")), default=0)

    def has(self, key: str) -> bool:
        """Return whether this quantity is there."""
        return key in self.frame.columns

    def array(self, key: str) -> Array:
        """Return a column of numbers (n,)."""
        return self.frame[key].to_numpy().astype(float)

    def optional_column(self, key: str) -> Array | None:
        """Return a column of numbers (n,), read-only, or None where it is not there."""
        return read_only(self.array(key)) if self.has(key) else None

    def group(self, keys: Sequence[str], lacking: str) -> Array | None:
        """Return columns that belong together (n, k), read-only, or None where none of them is there.

        Raises:
            InputError: ``lacking``, with the names of the columns, where only some are there.
        """
        missing = [key for key in keys if not self.has(key)]
        if len(missing) == len(keys):
            return None
        if missing:
            convention = next(_convention_of(self.units.get(key, "")) for key in keys if self.has(key))
            names = ", ".join(spellings(key, convention) for key in missing)
            raise InputError(f"{self.source.file}: {lacking.format(names)}")
        return read_only(np.ascontiguousarray(self.frame.select(keys).to_numpy()))

    def joints(self, stem: str, n_joints: int) -> Array | None:
        """Return a quantity of the joints (n, N), read-only, or None.

        Raises:
            InputError: some joints have it and some have not.
        """
        keys = [f"{stem}{joint}" for joint in range(1, n_joints + 1)]
        return self.group(keys, f"the robot has {n_joints} joints, but there is no column {{}}")

    def names(self, key: str, otherwise: str = "") -> tuple[IntArray, tuple[str, ...]]:
        """Return a column of names as indices (n,) into them, and these; one for all where it is not there."""
        return index_names(self.frame[key].to_list() if self.has(key) else [otherwise] * self.frame.height)


def read_table(path: Path, n_joints: int) -> RunTable:
    """Read a ``.csv`` or ``.parquet`` file in the columns of a run; which of them must be there is asked later.

    Raises:
        InputError: the file is missing, empty or ragged, a column has a wrong unit, a field is blank or no number.
    """
    if path.suffix.lower() == ".parquet":
        return _read_parquet(path, n_joints)
    lines = read_lines(path)
    head, headers = split_head(lines)
    if not headers:
        raise InputError(f"{path}: the file is empty; a line with the names of the columns is expected")
    foreign = foreign_table(lines) if len(headers) == 1 and set(headers[0]) & {";", "\t"} else None
    separator, decimal = (",", ".") if foreign is None else (foreign.separator, foreign.decimal)
    headers = headers if foreign is None else list(foreign.titles)
    columns, warnings = recognise_columns(headers, n_joints, str(path))
    if not columns:
        if path.suffix.lower() in (".json", ".toml"):
            raise InputError(
                f"{path}: is no table: a run is a .csv or .parquet file; --plan names a plan, --cell a cell"
            )
        raise InputError(f"{path}: no column has a name of a run's; {import_advice(path)}")
    above = len(head) + 1 if foreign is None else foreign.skip + 1 + foreign.has_units
    source = RowSource.of_text(
        str(path), lines, above, len(headers), {c.key: c.header for c in columns.values()}, separator=separator
    )
    numbers = frozenset(c.header for c in columns.values() if c.stem not in NAMES)
    unique = [h if headers.index(h) == i and h else f"{h}#{i + 1}" for i, h in enumerate(headers)]
    source, frame = parse_rows(source, unique, numbers, decimal)
    if foreign is not None:
        between = "tabs" if separator == "\t" else f"'{separator}'"
        warnings.append(f"{path.name}: was read with {between} between columns and '{decimal}' as the decimal sign")
    return table_in_si(source, frame, list(columns.values()), _with_axes(path, notes_in(head), lines), warnings)


def import_advice(path: Path | str) -> str:
    """Say how a table with titles of its own is brought in."""
    step = f"edbb import {as_word(path)} --map map.toml -o run.csv"
    return f"{step} reads other names (map.toml is proposed where there is none)"


def _with_axes(path: Path, notes: Mapping[str, str], lines: Iterable[str]) -> Mapping[str, str]:
    """Return the notes of a file, and whose axes its angles are where a line says it."""
    language = axes_line(str(path), lines)
    return notes if language is None else {**notes, AXES_OF: language}


def table_in_si(
    source: RowSource,
    frame: pl.DataFrame,
    columns: Sequence[RunColumn],
    notes: Mapping[str, str],
    warnings: Sequence[str] = (),
) -> RunTable:
    """Return the table of ``columns`` in SI units, checked for blanks and numbers that are none.

    Raises:
        InputError: there is no row, a field is blank or not finite, or angles in radians are called degrees.
    """
    if frame.height == 0:
        raise InputError(f"{source.file}: there is no row below the names of the columns")
    si = frame.select(
        (pl.col(c.header) if c.factor == 1.0 else pl.col(c.header) * c.factor).alias(c.key) for c in columns
    )
    check_finite(si, source, MAY_BE_BLANK)
    plausible = {**PLAUSIBLE, **{key: kind.plausible for key, kind in scalar_kinds().items()}}
    ranges = {c.key: plausible[c.stem] for c in columns if c.stem in plausible}
    check_range(si, source, ranges, {c.key: (c.unit, c.factor) for c in columns})
    for c in columns:
        if c.stem in NAMES:
            check_names(si[c.key], source)
        if c.stem in WHOLE:
            check_whole(si[c.key], source, ALLOWED.get(c.stem, ()))
    source, si, lost = drop_lost_positions(source, si)
    table = RunTable(source, si, {c.key: c.unit for c in columns}, notes, (*warnings, *lost))
    return replace(table, warnings=(*table.warnings, *_radians_as_degrees(table)))


def _radians_as_degrees(table: RunTable) -> list[str]:
    """Refuse joint angles in degrees that move like radians do; warn where they do not move enough to tell.

    This is judged as the file has them: axes of a controller with a zero of its own look otherwise once they are
    turned into the model's joints.
    """
    said = []
    for stem in ("q", "cmd"):
        keys = [k for k in table.frame.columns if split_key(k)[0] == stem and table.units.get(k) == "deg"]
        small = find_small(to_deg(table.frame.select(keys).to_numpy()))
        if small is None or table.notes.get(NOTE) == DEGREES:
            continue
        columns, cure = f"{table.source.headers.get(keys[0], keys[0])} …", f"{keys[0]}_rad"
        if small.are_radians:
            raise InputError(f"{table.source.file}: {small.refusal(columns, cure)}")
        said.append(f"{table.source.name}: {small.describe_doubt(columns, cure)}")
    return said


def _read_parquet(path: Path, n_joints: int) -> RunTable:
    check_readable(path, 500_000_000)  # bytes of a file: with 60 million fields in it 1.7 GB while they are read
    try:
        lazy = pl.scan_parquet(path)
        rows, width = lazy.select(pl.len()).collect().item(), len(lazy.collect_schema())
        # 60_000_000: fields: 1.7 GB while they are read
        if rows * width > 60_000_000:  # a few bytes can say a thousand million equal rows
            raise InputError(f"{path}: {rows} rows of {width} columns are more than any run has")
        frame = lazy.collect()
        meta = pl.read_parquet_metadata(path)
    except (OSError, ValueError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as err:
        raise InputError(f"{path}: cannot be read as Parquet ({(str(err).splitlines() or ['empty'])[0]})") from err
    columns, warnings = recognise_columns(frame.columns, n_joints, str(path))
    known = list(columns.values())
    source = RowSource(str(path), np.arange(1, frame.height + 1), headers={c.key: c.header for c in known})
    for c in known:
        wanted = pl.String if c.stem in NAMES else pl.Float64
        switch = ALLOWED.get(c.stem) == (0, 1) and frame.schema[c.header] == pl.Boolean
        if wanted == pl.Float64 and not (frame.schema[c.header].is_numeric() or switch):
            raise InputError(f"{path}: the column '{c.header}' holds {frame.schema[c.header]}, not numbers")
        if frame.schema[c.header].is_nested() or frame.schema[c.header] == pl.Binary:
            raise InputError(f"{path}: the column '{c.header}' holds {frame.schema[c.header]}, not names")
        value = pl.col(c.header)
        if wanted == pl.String and frame.schema[c.header].is_float() and (frame[c.header] % 1.0 == 0.0).all():
            value = value.cast(pl.Int64)  # sockets numbered in floats are still called 1, 2
        frame = frame.with_columns(value.cast(wanted))
    known_notes = {key: value for key, value in sorted(meta.items()) if key in NOTES}
    notes = _with_axes(path, known_notes, (f"# {key}: {value}" for key, value in sorted(meta.items())))
    return table_in_si(source, frame, known, notes, warnings)
