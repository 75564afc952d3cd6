"""Tables of a robot: DH or MDH rows of other software, and what a calibration adds to ``robot.toml``."""

import csv
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, field_validator

from planner.common.errors import InputError, did_you_mean
from planner.common.files import read_utf8
from planner.common.numbers import parse_number
from planner.common.schema import StrictModel
from planner.common.text_table import decimal_sign, separator_of, with_point
from planner.common.units import DEG, MM, from_deg, from_mm, read_only, si_unit
from planner.kinematics.angle_units import degrees_text
from planner.kinematics.bodies import Vector
from planner.kinematics.chain import Transform
from planner.kinematics.robot import BASE_TRANSFORMS, Loads, RobotEffect, ToolPoint


class RobotEffectTable(StrictModel):
    """One ``[[effects]]`` table: the elementary transform ``on`` gets ``value`` · ``phi`` beside its nominal value."""

    name: str
    on: str
    phi: str
    value: float
    unit: str
    static: bool = True

    @field_validator("unit")
    @classmethod
    def _check_unit(cls, value: str) -> str:
        si_unit(value)
        return value


class LoadsTable(StrictModel):
    """The ``[loads]`` table: tool and base as they were when the effects were found."""

    payload_kg: Annotated[float, Field(ge=0, le=5000)] = 0.0
    com_mm: Vector = (0.0, 0.0, 0.0)
    base_rpy_deg: Vector = (0.0, 0.0, 0.0)


class ToolPointTable(StrictModel):
    """One ``[[tool_points]]`` table: where a measured point sits in the flange that belongs to a calibrated robot."""

    name: str = ""
    position_mm: Vector
    std_mm: Vector | None = None
    std_beside_robot_mm: Vector | None = None

    def point(self) -> ToolPoint:
        """Return the tool point in SI units."""
        own, beside = (None if v is None else read_only(from_mm(v)) for v in (self.std_mm, self.std_beside_robot_mm))
        return ToolPoint(self.name, read_only(from_mm(self.position_mm)), own, beside)


def effects_from_tables(
    path: Path, tables: tuple[RobotEffectTable, ...], rows: tuple[Transform, ...]
) -> tuple[RobotEffect, ...]:
    """Return the effects in SI units.

    Raises:
        InputError: an effect acts on no transform of this robot.
    """
    known = [t.name for t in (*rows, *BASE_TRANSFORMS)]
    out = []
    for k, e in enumerate(tables, 1):
        if e.on not in known:
            raise InputError(
                f"{path}: effect {k} '{e.name}' acts on '{e.on}', which is no transform of this robot"
                f"{did_you_mean(e.on, known)} (there are: {', '.join(known)})"
            )
        unit, factor = si_unit(e.unit)
        out.append(RobotEffect(e.name, e.on, e.phi, e.value * factor, unit, e.static))
    return tuple(out)


def loads_from_table(file: LoadsTable | None) -> Loads | None:
    """Return the loads in SI units."""
    if file is None:
        return None
    return Loads(file.payload_kg, read_only(from_mm(file.com_mm)), read_only(from_deg(file.base_rpy_deg)))


def nominal_from_table(path: Path, table: Mapping[str, float], rows: tuple[Transform, ...]) -> tuple[Transform, ...]:
    """Return the transforms of the controller's own model: ``rows`` with the values of the ``[nominal]`` table.

    Raises:
        InputError: a key names no transform of this robot with its unit.
    """
    known = {nominal_key(t): t.name for t in rows}
    values = {}
    for key, value in table.items():
        if key not in known:
            raise InputError(
                f"{path}: nominal.{key} names no transform of this robot{did_you_mean(key, list(known))} "
                f"(there are: {', '.join(known)})"
            )
        values[known[key]] = value * (MM if key.endswith("_mm") else DEG)
    return tuple(replace(t, nominal=values.get(t.name, t.nominal)) for t in rows)


def nominal_key(t: Transform) -> str:
    """Return the key of a transform in the ``[nominal]`` table: ``a2_mm``, ``theta2_deg``."""
    return f"{t.name}_{'mm' if t.kind == 'translation' else 'deg'}"


ROW = ("alpha", "a", "theta", "d")
ANGLES = ("alpha", "theta", "beta", "zero", "lower", "upper", "speed")
LENGTHS = ("a", "d")
TURNS = ("alpha", "theta", "beta", "zero")
PLAIN = ("sense", "name")
ROW_KEYS = {"alpha": "alpha_deg", "theta": "theta_deg", "beta": "beta_deg", "a": "a_mm", "d": "d_mm"}
KEYS = ROW_KEYS | {"zero": "zero_deg"}
CONVENTION = re.compile(r"#\s*convention\s*:\s*(\S+)", re.IGNORECASE)


def read_dh_table(path: Path) -> dict[str, object]:
    """Return convention and joints, as ``robot.toml`` has them, of a table with one row a joint, from base to flange.

    Its first line names the columns with their units (``alpha_rad, a_mm, theta_rad, d_mm``, in any order; ``beta``,
    ``zero``, ``lower``, ``upper``, ``speed``, ``sense``, ``name`` where they are known); a line ``# convention: mdh``
    (or ``dh``) above it says what the rows mean.

    Raises:
        InputError: with the line, what was found and what is allowed.
    """
    lines = [(n, line.strip()) for n, line in enumerate(read_utf8(path).splitlines(), 1) if line.strip()]
    said = [m[1].lower() for _, line in lines if (m := CONVENTION.match(line))]
    if said not in (["dh"], ["mdh"]):
        raise InputError(
            f"{path}: a line '# convention: mdh' (modified DH, as RoboDK and pybotics have it) or '# convention: dh' "
            f"must say what the rows mean{f', found {said}' if said else ''}"
        )
    (top, header), *rows = [(n, line) for n, line in lines if not line.startswith("#")] or [(1, "")]
    sign = separator_of(header)
    decimal = decimal_sign("\n".join(line for _, line in rows), sign)
    columns = [_column(path, top, title) for title in header.split(sign)]
    if gone := [key for key in ROW if key not in {key for key, _ in columns}]:
        raise InputError(
            f"{path}, line {top}: no column {', '.join(gone)}; the columns are {', '.join(ROW)} with units"
        )
    fields = csv.reader((line for _, line in rows), delimiter=sign)
    joints = [
        _joint(f"{path}, line {n}", columns, [with_point(cell, decimal) for cell in row])
        for (n, _), row in zip(rows, fields, strict=True)
    ]
    return {"convention": said[0], "joints": joints}


def _column(path: Path, line: int, title: str) -> tuple[str, float]:
    """Return what a column holds and the factor to degrees or millimetres; ``α (°)`` is ``alpha_deg``."""
    plain = title.strip().strip('"').lower().replace("α", "alpha").replace("θ", "theta").replace("°", "deg")
    key, _, unit = re.sub(r"[\s(\[/]+", "_", plain).rstrip(")]_").partition("_")
    if key in PLAIN and not unit:
        return key, 1.0
    allowed = ("mm", "m") if key in LENGTHS else ("deg_s", "rad_s") if key == "speed" else ("deg", "rad")
    if key not in (*LENGTHS, *ANGLES):
        known = [*LENGTHS, *ANGLES, *PLAIN]
        raise InputError(f"{path}, line {line}: '{title.strip()}' is no column of a DH table{did_you_mean(key, known)}")
    if unit not in allowed:
        called = " or ".join(f"{key}_{u}" for u in allowed)
        raise InputError(f"{path}, line {line}: '{title.strip()}' does not say its unit: {called}")
    # to mm and degrees, as robot.toml has them
    factors = {"deg": 1.0, "rad": 180.0 / np.pi, "mm": 1.0, "m": 1e3, "deg_s": 1.0, "rad_s": 180.0 / np.pi}
    return key, factors[unit]


def _joint(where: str, columns: list[tuple[str, float]], row: list[str]) -> dict[str, object]:
    if len(row) != len(columns):
        raise InputError(f"{where}: {len(row)} fields, but {len(columns)} columns")
    found: dict[str, float] = {}
    joint: dict[str, object] = {}
    for (key, factor), field in zip(columns, row, strict=True):
        if key == "name":
            joint["name"] = field.strip()
            continue
        try:
            found[key] = parse_number(field) * factor
        except ValueError as err:
            raise InputError(f"{where}, column '{key}': {field.strip()!r} is no number") from err
    if why := degrees_text([found[key] * DEG for key, factor in columns if factor != 1.0 and key in TURNS]):
        raise InputError(f"{where}: {why}; if degrees are meant, call the columns alpha_deg and theta_deg")
    joint |= {KEYS[key]: value for key, value in found.items() if key in KEYS}
    if "sense" in found:
        joint["sense"] = int(found["sense"])
    if "lower" in found and "upper" in found:
        joint["limit_deg"] = (found["lower"], found["upper"])
    if speed := found.get("speed"):
        joint["speed_deg_s"] = speed
    return joint
