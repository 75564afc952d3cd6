"""Writes a calibrated robot: ``robot.toml`` with corrected rows, and for a robot from a URDF the corrected URDF."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import tomli_w

from planner.common.units import DEG, MM, Array, file_unit, si_unit, to_deg, to_mm
from planner.kinematics.calibration_tables import nominal_key
from planner.kinematics.joint_origins import exported_models
from planner.kinematics.robot import Loads, Robot, RobotEffect
from planner.kinematics.robot_reader import describe_robot
from planner.kinematics.urdf import is_urdf, read_urdf, write_urdf

DIGITS = {"translation": 8, "rotation": 10}  # decimals of mm and deg: 1e-11 m, 2e-12 rad
ROW_KEYS = {"theta": "theta_deg", "d": "d_mm", "a": "a_mm", "alpha": "alpha_deg", "beta": "beta_deg"}
HEADER = """\
# Calibrated robot, to be used wherever the nominal one is. {remark}
# The controller's own model stays as it is: where it differs from this file, its values stand in [nominal].
"""
NOMINAL_MARK = "#\n# The nominal file says:\n"
NUMBERS = re.compile(r"\[\s+((?:[-+.\deE]+,\s+)+)\]")  # an array of numbers, one a line


@dataclass(frozen=True)
class RobotCorrections:
    """What a calibration found of a robot.

    Attributes:
        values: elementary transforms that changed: name and corrected value [m, rad].
        effects: what was found beyond geometry, and the ``loads`` it was found under.
        source: one sentence: which run, which fit.
    """

    values: tuple[tuple[str, float], ...]
    effects: tuple[RobotEffect, ...]
    loads: Loads | None
    source: str


def write_robot(robot: Robot, found: RobotCorrections) -> tuple[tuple[str, str], ...]:
    """Return name and text of the files of the corrected robot: ``robot.toml``, and ``robot.urdf`` where it has one.

    Meshes of collision bodies are looked for where :func:`mesh_files` says.

    Raises:
        InputError: the robot's own file can no longer be read.
    """
    values = dict(found.values)
    content = _nominal_content(robot)
    meshes = mesh_names(robot)
    files: list[tuple[str, str]] = []
    changed = frozenset(t.name for t in robot.transforms if values.get(t.name, t.nominal) != t.nominal)
    if robot.convention == "urdf":
        text, changed = write_urdf(urdf_path(robot), robot.tip, values, meshes, found.source)
        content |= {"urdf": "robot.urdf", "tip": str(robot.tip)}
        content.pop("srdf", None)
        if robot.srdf is not None:
            pairs = [list(pair) for pair in sorted(robot.never_meet)]
            content |= {"never_meet": pairs, "never_meet_reason": robot.never_meet_reason}
        files.append(("robot.urdf", text))
    else:
        _correct_rows(robot, content, {n: values[n] for n in sorted(changed)})
        files += exported_models(robot, values)
    for body in _tables(content, "bodies"):
        if "file" in body:
            body["file"] = meshes[(robot.path.parent / str(body["file"])).resolve()]
    sources = {"calibration": f"{found.source} The controller's own model is unchanged; its values are in [nominal]."}
    content["sources"] = dict(robot.sources) | sources
    content |= _calibration_tables(robot, changed, found)
    text = HEADER.format(remark=found.source.replace("\n", " ")) + _head_comments(robot.path) + "\n" + _toml(content)
    return (("robot.toml", text), *files)


def mesh_names(robot: Robot) -> dict[Path, str]:
    """Return where each mesh of the robot's collision bodies goes beside the written files: file and new name."""
    bodies = [b for _, b in robot.bodies]
    if robot.convention == "urdf":  # the file's own bodies, where robot.toml has others
        bodies += [b for _, b in read_urdf(urdf_path(robot), robot.tip).bodies]
    out: dict[Path, str] = {}
    for path in dict.fromkeys(b.mesh.resolve() for b in bodies if b.mesh is not None):
        again = sum(p.name == path.name for p in out)
        out[path] = f"meshes/{path.stem}{f'_{again + 1}' if again else ''}{path.suffix}"
    return out


def mesh_files(robot: Robot) -> tuple[tuple[str, bytes], ...]:
    """Return name and content of the meshes that the written files refer to."""
    return tuple((name, path.read_bytes()) for path, name in mesh_names(robot).items())


def urdf_path(robot: Robot) -> Path:
    """Return the URDF that the robot was read from."""
    return robot.path.parent / str(describe_robot(robot.path).urdf)


def _nominal_content(robot: Robot) -> dict[str, object]:
    """Return the file's content without what an earlier calibration added; a bare URDF gets the few keys it needs."""
    if is_urdf(robot.path):
        return {"schema": "edbb-robot/1", "name": robot.name, "convention": "urdf"}
    file = describe_robot(robot.path)
    added = {"effects", "loads", "nominal"}
    return file.model_dump(mode="json", by_alias=True, exclude=added, exclude_unset=True, exclude_none=True)


def _head_comments(path: Path) -> str:
    """Return the comments that the nominal file begins with, from a calibrated file those that it has carried on."""
    if path.suffix != ".toml":
        return ""
    text = re.match(r"(?:\s*#.*\n)*", path.read_text(encoding="utf-8"))
    head = text[0] if text else ""
    if head.startswith(HEADER[:20]):
        head = head.partition(NOMINAL_MARK)[2]
    return NOMINAL_MARK + head.rstrip("\n") + "\n" if head.strip() else ""


def _toml(content: Mapping[str, object]) -> str:
    """Write TOML with arrays of numbers in one line."""
    return NUMBERS.sub(lambda m: f"[{', '.join(m[1].replace(',', ' ').split())}]", tomli_w.dumps(content))


def _correct_rows(robot: Robot, content: dict[str, object], values: Mapping[str, float]) -> None:
    joints = _tables(content, "joints")
    for name, value in values.items():
        key = name.rstrip("0123456789")
        index = int(name[len(key) :])
        back = robot.convention == "mdh" and key in ("alpha", "a", "beta")  # of index i−1, in row i
        joints[index if back else index - 1][ROW_KEYS[key]] = _file_value(key in ("a", "d"), value)


def _calibration_tables(robot: Robot, changed: frozenset[str], found: RobotCorrections) -> dict[str, object]:
    """Return the tables ``nominal``, ``loads`` and ``effects``."""
    nominal = {
        nominal_key(t): _file_value(t.kind == "translation", t.nominal)
        for t, now in zip(robot.nominal.transforms, robot.transforms, strict=True)
        if t.name in changed or t.nominal != now.nominal
    }
    out: dict[str, object] = {"nominal": nominal} if nominal else {}
    if found.loads is not None:
        out["loads"] = {
            "payload_kg": found.loads.payload,
            "com_mm": _rounded_list(to_mm(found.loads.com_F)),
            "base_rpy_deg": _rounded_list(to_deg(found.loads.base_rpy)),
        }
    if found.effects:
        out["effects"] = [_effect_table(e) for e in found.effects]
    return out


def _effect_table(e: RobotEffect) -> dict[str, object]:
    unit = file_unit(e.unit)
    value = float(f"{e.value / si_unit(unit)[1]:.12g}")
    out: dict[str, object] = {"name": e.name, "on": e.on, "phi": e.phi, "value": value, "unit": unit}
    return out if e.static else out | {"static": False}


def _tables(content: dict[str, object], key: str) -> list[dict[str, object]]:
    tables = content.get(key, [])
    assert isinstance(tables, list)
    return tables


def _file_value(length: bool, value: float) -> float:
    """Return a value [m, rad] in mm or degrees, as it is written."""
    return round(value / MM, DIGITS["translation"]) + 0.0 if length else round(value / DEG, DIGITS["rotation"]) + 0.0


def _rounded_list(v: Array) -> list[float]:
    return [round(float(c), 10) + 0.0 for c in v]
