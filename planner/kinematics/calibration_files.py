"""Calibrations of one arm as its maker's software writes them: ``calibration.conf`` of UR, ``kinematics`` of ROS."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

from planner.common.errors import InputError
from planner.common.files import read_bytes, read_utf8
from planner.common.numbers import parse_number
from planner.common.units import DEG, MM
from planner.kinematics.robot_tables import ROW_KEYS
from planner.kinematics.xacro.template_files import read_yaml

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
    content = read_yaml(path, read_bytes(path, 200_000), float)
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


def _origin(path: Path, name: str, entry: object) -> Sequence[float]:
    found = entry if isinstance(entry, Mapping) else {}
    if set(map(str, found)) != set(ORIGIN) or not all(isinstance(v, int | float) for v in found.values()):
        raise InputError(f"{path}: {name} needs the six numbers {', '.join(ORIGIN)} (m, rad), and has {dict(found)}")
    return [float(found[key]) for key in ORIGIN]
