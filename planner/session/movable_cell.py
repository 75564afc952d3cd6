"""A cell that can be moved: the content of its file, with robot and meshes in the folder that it is laid into."""

import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import tomli_w

from planner.cell.cell import Cell
from planner.common.files import data_folder, read_bytes, read_utf8
from planner.common.schema import read_toml_content
from planner.kinematics.robot_hash import renew_hashes
from planner.kinematics.robot_writer import mesh_names, urdf_path
from planner.kinematics.urdf import plain_name
from planner.kinematics.urdf_writer import write_urdf


def movable_cell(cell: Cell) -> tuple[dict[str, object], dict[str, Path]]:
    """Return the content of ``cell.toml``, defaults included, its names good in any folder, and its files by name.

    The robot has its file's name, a mesh and a fleet one of its own hash.
    """
    content = cell.file.model_dump(mode="json", by_alias=True)
    if not is_shipped(cell):
        content["robot"] = plain_name(cell.robot.path).name
    content.pop("packages", None)
    if stands := cell.robot.parked_table:
        content["parked"] = stands  # those that nobody has said too: the proof holds where they stand
    meshes: dict[str, Path] = {}
    for body in _bodies(content):
        if body.get("kind") == "mesh" and body.get("file"):
            path = (cell.path.parent / str(body["file"])).resolve()
            name = f"meshes/{hashlib.sha256(read_bytes(path)).hexdigest()[:12]}{path.suffix}"
            body["file"], meshes[name] = name, path
    if cell.file.prior is not None:
        path = (cell.path.parent / cell.file.prior.fleet).resolve()
        name = f"fleet-{hashlib.sha256(read_bytes(path)).hexdigest()[:12]}.toml"
        content["prior"], meshes[name] = {"fleet": name}, path
    return content, meshes


def is_shipped(cell: Cell) -> bool:
    """Tell whether the robot is one that comes with the planner."""
    return cell.robot.path.is_relative_to(data_folder("robots"))


def cell_files(cell: Cell) -> dict[str, bytes]:
    """Return ``cell.toml`` and what belongs to it by name: meshes, and a robot that is not a shipped one."""
    content, meshes = movable_cell(cell)
    files = {"cell.toml": tomli_w.dumps(_without_none(content)).encode()}
    files |= {name: read_bytes(path) for name, path in meshes.items()}
    return files if is_shipped(cell) else files | dict(_robot_files(cell))


def _robot_files(cell: Cell) -> Iterator[tuple[str, bytes]]:
    """The robot's file and its URDF as they are, but for the places of meshes."""
    robot, meshes = cell.robot, mesh_names(cell.robot)
    yield from ((name, read_bytes(path)) for path, name in meshes.items())
    if robot.convention == "urdf":
        urdf = urdf_path(robot)
        stands = robot.packages, robot.parked_table, robot.base
        text, _ = write_urdf(urdf, robot.tip, {}, meshes, "as it was planned", *stands)
        yield plain_name(urdf).name, text.encode()
        if robot.srdf is not None:
            yield robot.srdf.name, read_bytes(robot.srdf)
        if robot.path == urdf:
            return
    if robot.path.suffix == ".csv":
        yield robot.path.name, read_bytes(robot.path)
        return
    content, texts = read_toml_content(robot.path), dict[str, str]()
    found = [b for b in _tables(content.get("bodies")) if "file" in b]
    if not found and robot.convention != "urdf":
        yield robot.path.name, read_bytes(robot.path)
        return
    for body in found:
        body["file"] = meshes[(robot.path.parent / str(body["file"])).resolve()]
    if robot.convention == "urdf":
        content["urdf"] = plain_name(urdf).name
        texts[plain_name(urdf).name] = text
        content.pop("packages", None)  # the URDF is whole, and its meshes lie beside it
        if robot.srdf is not None:
            content["srdf"] = robot.srdf.name
            texts[robot.srdf.name] = read_utf8(robot.srdf)
    yield robot.path.name, tomli_w.dumps(renew_hashes(content, texts, robot.hand_edits)).encode()


def _bodies(content: Mapping[str, object]) -> Iterator[dict[str, object]]:
    yield from _tables(content.get("obstacles"))
    for owner in (content.get("tool"), content.get("artifact")):
        yield from _tables(owner.get("bodies") if isinstance(owner, dict) else None)


def _tables(value: object) -> list[dict[str, object]]:
    return [v for v in value if isinstance(v, dict)] if isinstance(value, list | tuple) else []


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _without_none(v) for k, v in value.items() if v is not None}
    return [_without_none(v) for v in value] if isinstance(value, list | tuple) else value
