"""Writes a calibrated robot: ``robot.toml`` with corrected rows, and for a robot from a URDF the corrected URDF."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
import tomli_w

from planner.common.content_hashes import HASHES
from planner.common.file_names import name_fault
from planner.common.files import read_utf8
from planner.common.units import DEG, MM, Array, file_unit, si_unit, to_deg, to_mm
from planner.kinematics.calibration_files import ROW_KEYS, nominal_key
from planner.kinematics.chain import Transform, is_of_link_before
from planner.kinematics.geometry import log3, rpy_of
from planner.kinematics.robot import Loads, Robot, RobotEffect, ToolPoint, elementary_placement
from planner.kinematics.robot_hash import robot_hashes
from planner.kinematics.robot_reader import describe_robot
from planner.kinematics.urdf import is_urdf
from planner.kinematics.urdf_writer import find_meshes, write_urdf

UR_LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")


def joint_origins(robot: Robot, values: Mapping[str, float]) -> tuple[list[Array], Array]:
    """Return the frame of each joint in that of the joint before, at controller angle zero, and the flange in the last.

    A shift along a joint's own axis stands before its turn, as URDF files have it. ``values`` are corrected values of
    elementary transforms [m, rad]; the joints of the robot turn about z of their rows (DH and MDH).
    """
    origins: list[Array] = []
    T = np.eye(4)
    after_turn = False  # what commutes with the turn that has just been passed
    for t in robot.transforms:
        step = elementary_placement(t, values.get(t.name, t.nominal) + _zero(robot, t))
        if after_turn and t.axis == 2:
            origins[-1] = origins[-1] @ step
            continue
        T, after_turn = T @ step, t.joint is not None
        if after_turn:
            origins.append(T)
            T = np.eye(4)
    return origins, T


def _zero(robot: Robot, t: Transform) -> float:
    return 0.0 if t.joint is None else float(robot.theta_zero[t.joint])


def exported_models(robot: Robot, values: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    """Yield name and text of the models that other software reads, of a robot of DH or MDH rows without coupled axes.

    ``robot.urdf`` where the joints have names, ``calibration.yaml`` of ur_description for the robots of UR.
    """
    sense = np.diag(robot.coupling_matrix)
    if robot.convention == "urdf" or not np.array_equal(np.diag(sense), robot.coupling_matrix):
        return
    if robot.joint_names:
        yield "robot.urdf", _urdf(robot, values, sense)
    if robot.dialect == "urscript" and robot.n_joints == len(UR_LINKS) and (sense == 1.0).all():
        yield "calibration.yaml", _ur_calibration(robot, values)


def _urdf(robot: Robot, values: Mapping[str, float], sense: np.ndarray) -> str:
    origins, flange = joint_origins(robot, values)
    n = robot.n_joints
    links = ["base_link", *(f"link_{i}" for i in range(1, n + 1)), "flange"]
    lines = ['<?xml version="1.0"?>', f"<robot name={quoteattr(robot.name)}>"]
    lines += [f'  <link name="{name}"/>' for name in links]
    for i, (name, T) in enumerate(zip(robot.joint_names, origins, strict=True)):
        lines += [
            f'  <joint name={quoteattr(name)} type="revolute">',
            *_link_lines(links[i], links[i + 1], T),
            f'    <axis xyz="0 0 {sense[i]:g}"/>',
            f'    <limit lower="{robot.q_lower[i]:.9g}" upper="{robot.q_upper[i]:.9g}" '
            f'velocity="{robot.speed[i]:.9g}" effort="0"/>',
            "  </joint>",
        ]
    lines += ['  <joint name="flange_joint" type="fixed">', *_link_lines(links[n], "flange", flange), "  </joint>"]
    return "\n".join([*lines, "</robot>", ""])


def _link_lines(parent: str, child: str, T: Array) -> list[str]:
    xyz, rpy = (" ".join(f"{v + 0.0:.12g}" for v in np.round(part, 13)) for part in _pose(T))
    return [f'    <parent link="{parent}"/>', f'    <child link="{child}"/>', f'    <origin xyz="{xyz}" rpy="{rpy}"/>']


def _pose(T: Array) -> tuple[np.ndarray, np.ndarray]:
    return T[:3, 3], rpy_of(T[:3, :3])


def _ur_calibration(robot: Robot, values: Mapping[str, float]) -> str:
    """The file that ``kinematics_params_file`` of ur_robot_driver takes; keys as in ur_description's own."""
    origins, behind = joint_origins(robot, values)
    lines = [
        "# For kinematics_params_file of ur_description. The hash is not the robot's: its driver says that the robot's",
        "# own calibration is another, which is right.",
    ]
    off = np.abs(np.concatenate([behind[:3, 3], log3(behind[:3, :3])]))
    if off.max() > 1e-7:  # [m, rad] of a transform behind the last joint that such a file has no place for
        lines.append(
            "# Behind the last joint more was found, which this file has no place for: it belongs to the tool:"
        )
        lines.append("# " + " ".join(f"{v:.9g}" for part in _pose(behind) for v in part) + " (xyz in m, rpy in rad)")
    lines.append("kinematics:")
    for name, T in zip(UR_LINKS, origins, strict=True):
        numbers = np.round(np.concatenate(_pose(T)), 13) + 0.0
        lines.append(f"  {name}:")
        lines += [
            f"    {k}: {v!r}" for k, v in zip(("x", "y", "z", "roll", "pitch", "yaw"), numbers.tolist(), strict=True)
        ]
    return "\n".join([*lines, "  hash: calib_edbb", ""])


DIGITS = {"translation": 8, "rotation": 10}  # decimals of mm and deg: 1e-11 m, 2e-12 rad
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
        tool_points: where the measured points sit in the flange of the corrected robot.
        simulated: whether the readings were simulated; ``None`` leaves it unsaid.
        not_for_use: why nothing may be made of this robot; empty where it may be used.
    """

    values: tuple[tuple[str, float], ...]
    effects: tuple[RobotEffect, ...]
    loads: Loads | None
    source: str
    tool_points: tuple[ToolPoint, ...] = ()
    simulated: bool | None = None
    not_for_use: str = ""


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
        text, changed = write_urdf(
            urdf_path(robot), robot.tip, values, meshes, found.source, robot.packages, robot.parked_table, robot.base
        )
        content |= {"urdf": "robot.urdf", "tip": str(robot.tip)}
        if robot.base is not None:
            content["base"] = robot.base
        content.pop("packages", None)
        if robot.parked:
            content["parked"] = robot.parked_table
        files.append(("robot.urdf", text))
        if robot.srdf is not None:
            content["srdf"] = "robot.srdf"
            files.append(("robot.srdf", read_utf8(robot.srdf)))
    else:
        _correct_rows(robot, content, {n: values[n] for n in sorted(changed)})
        files += exported_models(robot, values)
    for body in _tables(content, "bodies"):
        if "file" in body:
            body["file"] = meshes[(robot.path.parent / str(body["file"])).resolve()]
    sources = {"calibration": f"{found.source} The controller's own model is unchanged; its values are in [nominal]."}
    content["sources"] = dict(robot.sources) | sources
    content |= _calibration_tables(robot, changed, found)
    content[HASHES] = robot_hashes(content, dict(files))
    text = HEADER.format(remark=found.source.replace("\n", " ")) + _head_comments(robot.path) + "\n" + _toml(content)
    return (("robot.toml", text), *files)


def mesh_names(robot: Robot) -> dict[Path, str]:
    """Return where each mesh of the robot goes beside the written files: file and new name."""
    files = [b.mesh.resolve() for _, b in robot.bodies if b.mesh is not None]
    if robot.convention == "urdf":  # those to look at too, and the file's own bodies where robot.toml has others
        files += find_meshes(urdf_path(robot), robot.packages)
    out: dict[Path, str] = {}
    for path in dict.fromkeys(files):
        stem = f"mesh_{path.stem}" if name_fault(path.stem) else path.stem
        again = (f"meshes/{stem}{f'_{k}' if k > 1 else ''}{path.suffix}" for k in count(1))
        out[path] = next(name for name in again if name not in out.values())
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
    added = {"effects", "loads", "nominal", "tool_points", "simulated", "not_for_use", HASHES}
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
        row = int(name[len(key) :]) + is_of_link_before(robot.convention, key)
        joints[row - 1][ROW_KEYS[key]] = _file_value(key in ("a", "d"), value)


def _calibration_tables(robot: Robot, changed: frozenset[str], found: RobotCorrections) -> dict[str, object]:
    """Return the tables that a calibration adds, whether it was simulated, and why it is not to be used."""
    nominal = {
        nominal_key(t): _file_value(t.kind == "translation", t.nominal)
        for t, now in zip(robot.nominal_robot.transforms, robot.transforms, strict=True)
        if t.name in changed or t.nominal != now.nominal
    }
    out: dict[str, object] = {"nominal": nominal} if nominal else {}
    if found.loads is not None:
        out["loads"] = {
            "payload_kg": found.loads.payload,
            "com_mm": _rounded_list(to_mm(found.loads.com_F)),
            "base_rpy_deg": _rounded_list(to_deg(found.loads.base_rpy)),
        }
    if found.tool_points:
        out["tool_points"] = [_tool_point_table(t) for t in found.tool_points]
    if found.simulated is not None:
        out["simulated"] = found.simulated
    if found.not_for_use:
        out["not_for_use"] = found.not_for_use
    if found.effects:
        out["effects"] = [_effect_table(e) for e in found.effects]
    return out


def _tool_point_table(t: ToolPoint) -> dict[str, object]:
    std = {"std_mm": t.std, "std_beside_robot_mm": t.std_beside_robot}
    # 5: decimals of a standard deviation in mm
    return {
        **({"name": t.name} if t.name else {}),
        "position_mm": _rounded_list(to_mm(t.p_FM), DIGITS["translation"]),
        **{key: _rounded_list(to_mm(v), 5) for key, v in std.items() if v is not None},
    }


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


def _rounded_list(v: Array, decimals: int = 10) -> list[float]:
    return [round(float(c), decimals) + 0.0 for c in v]
