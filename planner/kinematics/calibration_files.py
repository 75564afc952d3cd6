"""Calibrations of one arm as its maker's software writes them: ``calibration.conf`` of UR, ``kinematics`` of ROS.

Tables of a robot: DH or MDH rows of other software, and what a calibration adds to ``robot.toml``.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated
from xml.sax.saxutils import quoteattr

import numpy as np
from pydantic import Field, field_validator

from planner.common.errors import InputError, did_you_mean
from planner.common.files import read_bytes, read_utf8
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


YAML = (".yaml", ".yml")
ROBOT_LINE = re.compile(r"^\s*#\s*robot\s*:\s*(\S+)", re.MULTILINE)
ARRAY = re.compile(r"^[ \t]*(?P<key>[A-Za-z]\w*)[ \t]*=[ \t]*\[(?P<values>[^\]]*)\]", re.MULTILINE)
PARTS = ("theta", "a", "d", "alpha")
UR_JOINTS = {  # of ur_description, by the names in its files of kinematics
    "shoulder": "shoulder_pan_joint", "upper_arm": "shoulder_lift_joint", "forearm": "elbow_joint",
    "wrist_1": "wrist_1_joint", "wrist_2": "wrist_2_joint", "wrist_3": "wrist_3_joint",
}  # fmt: skip
ORIGIN = ("x", "y", "z", "roll", "pitch", "yaw")


def robot_of_differences(path: Path) -> str:
    """Return the robot whose rows a ``calibration.conf`` differs from: its line ``# robot: ur5e`` names it.

    Raises:
        InputError: there is no such line.
    """
    found = ROBOT_LINE.search(read_utf8(path))
    if found is None:
        raise InputError(
            f"{path}: holds by how much the rows of one arm differ from those of its model, and does not say which "
            "model that is: add a line '# robot: ur5e' at its head (a shipped robot, or a robot.toml beside this file)"
        )
    return found[1]


def row_differences(path: Path, joints: int) -> list[dict[str, float]]:
    """Return what a ``calibration.conf`` of UR adds to each row, by the row's keys [mm, deg].

    Raises:
        InputError: an array is missing, has not a number for each joint, or is not known.
    """
    text = re.sub(r"#.*", "", read_utf8(path))
    arrays = {m["key"]: m["values"] for m in ARRAY.finditer(text) if m["key"].startswith("delta_")}
    known = [f"delta_{part}" for part in PARTS]
    if missing := [key for key in known if key not in arrays]:
        raise InputError(f"{path}: no {', '.join(missing)} = [...] is there; {', '.join(known)} are needed")
    if strange := [key for key in arrays if key not in known]:
        raise InputError(f"{path}: {strange[0]} is not known; {', '.join(known)} are read")
    values = {part: _numbers(path, f"delta_{part}", arrays[f"delta_{part}"], joints) for part in PARTS}
    units = {part: MM if part in ("a", "d") else DEG for part in PARTS}
    return [{ROW_KEYS[part]: values[part][k] / units[part] for part in PARTS} for k in range(joints)]


def _numbers(path: Path, key: str, text: str, count: int) -> list[float]:
    found = list[float]()
    for word in text.replace(",", " ").split():
        try:
            found.append(parse_number(word))
        except ValueError as err:
            raise InputError(f"{path}: {key}: '{word}' is no number") from err
    if len(found) != count:
        raise InputError(f"{path}: {key} has {len(found)} numbers, the robot has {count} joints")
    return found


def urdf_of_origins(path: Path) -> bytes:
    """Return the URDF that a file of joint origins means: a key a joint, each with x, y, z, roll, pitch, yaw [m, rad].

    ROS has such files of calibrated arms (``kinematics:`` of ur_description and others); each joint turns about z of
    its frame.

    Raises:
        InputError: it is no such file, or an origin lacks a number.
    """
    # 200_000: bytes; such a file has a thousand
    content = _read_yaml(path, read_bytes(path, 200_000))
    table = content.get("kinematics", content) if isinstance(content, Mapping) else None
    entries = {k: v for k, v in table.items() if isinstance(v, Mapping)} if isinstance(table, Mapping) else {}
    if not entries:
        raise InputError(f"{path}: holds no origins of joints (kinematics: a name a joint, with {', '.join(ORIGIN)})")
    origins = {str(k): _origin(path, str(k), v.get("kinematic", v)) for k, v in entries.items()}
    links = ["base", *origins]
    lines = [f"<robot name={quoteattr(path.stem)}>", *(f"<link name={quoteattr(name)}/>" for name in links)]
    for before, (name, numbers) in zip(links, origins.items(), strict=False):
        xyz, rpy = (" ".join(map(repr, part)) for part in (numbers[:3], numbers[3:]))
        lines.append(
            f'<joint name={quoteattr(UR_JOINTS.get(name, name))} type="revolute"><parent link={quoteattr(before)}/>'
            f'<child link={quoteattr(name)}/><origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="0 0 1"/></joint>'
        )
    return "\n".join([*lines, "</robot>"]).encode()


def _read_yaml(path: Path, data: bytes) -> object:
    try:
        import yaml
    except ImportError as err:
        raise InputError(
            f"{path}: is YAML, and the package that reads it is not installed: pip install pyyaml"
        ) from err
    try:
        if b"<<" in data:  # a few lines of them grow without end
            raise ValueError("a table that merges another (<<) is not read; write out its entries")
        return yaml.safe_load(data)
    except (yaml.YAMLError, ValueError, RecursionError) as err:
        raise InputError(f"{path}: cannot be read as YAML ({err})") from err


def _origin(path: Path, name: str, entry: object) -> Sequence[float]:
    found = entry if isinstance(entry, Mapping) else {}
    if set(map(str, found)) != set(ORIGIN) or not all(isinstance(v, int | float) for v in found.values()):
        raise InputError(f"{path}: {name} needs the six numbers {', '.join(ORIGIN)} (m, rad), and has {dict(found)}")
    return [float(found[key]) for key in ORIGIN]
