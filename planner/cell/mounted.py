"""What a cell file says of the tool and of the bar's fixtures: where the bar can hang."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.cell.file import FIRST_POINT, CellFile, FixtureFile, ToolFile
from planner.cell.parts import Fixture, Tool, ToolPoint
from planner.errors import InputError
from planner.robot import Robot
from planner.units import MM, UM, Array, from_deg, from_mm, frozen

UNKNOWN = 20.0 * MM  # what is left to find of a frame or tool point after it was placed from the run


def tool_of(path: Path, tool: ToolFile | None, robot: Robot, planning: bool) -> Tool:
    """Return the tool; without one, where that is enough, a point at the flange that the run will place.

    Raises:
        InputError: no tool where a plan needs one, one that is too heavy, or an axis that is none.
    """
    if tool is None and not planning:
        return Tool(frozen(np.zeros(3)), frozen([0, 0, 1]), 0.0, frozen(np.zeros(3)), (), UNKNOWN, known=False)
    if tool is None:
        raise InputError(
            f"{path}: the section [tool] with map_mm is missing; without it nothing says where the bar's ball sits"
        )
    if robot.payload is not None and tool.mass_kg > robot.payload:
        raise InputError(
            f"{path}: tool.mass_kg = {tool.mass_kg:g} exceeds the rated payload of {robot.name}, {robot.payload:g} kg"
        )
    points = _points(path, tool)
    return Tool(
        points[0].p_FM,
        points[0].axis_F,
        tool.mass_kg,
        frozen(from_mm(tool.com_mm)),
        tuple(b.body(f"tool_{k}", path.parent) for k, b in enumerate(tool.bodies)),
        tool.prior_mm * MM if tool.map_sigma_um is None else tool.map_sigma_um * UM,
        measured=tool.map_sigma_um is not None,
        points=points if len(points) > 1 else (),
    )


def _points(path: Path, tool: ToolFile) -> tuple[ToolPoint, ...]:
    """All points of the tool, that of ``map_mm`` first; an axis that is not given is the first one's."""
    given = [("tool.map_axis", FIRST_POINT, tool.map_mm, tool.map_axis)]
    given += [(f"tool.points.{p.name}.map_axis", p.name, p.map_mm, p.map_axis or tool.map_axis) for p in tool.points]
    return tuple(ToolPoint(name, frozen(from_mm(at)), _unit(path, key, axis)) for key, name, at, axis in given)


def fixtures_of(path: Path, robot: Robot, file: CellFile) -> tuple[Fixture, ...]:
    """Return the cups, each once for every tool point: all cups with the first point, then with the next.

    Raises:
        InputError: a mount pose that is none of the robot's, or one for several tool points.
    """
    more = file.tool.points if file.tool else ()
    given = [f"fixtures.{f.name}.mount_deg" for f in file.fixtures if f.mount_deg]
    given += ["gauge.mount_deg"] if file.gauge.mount_deg else []
    if more and file.fixtures and given:
        raise InputError(
            f"{path}: '{given[0]}' cannot hold the bar at each of {len(more) + 1} tool points: leave it out, good "
            "mount poses are found"
        )
    cups = tuple(_fixture(path, robot, f, file.gauge.mount_deg) for f in file.fixtures)
    return tuple(replace(cup, point=k) for k in range(len(more) + 1) for cup in cups)


def _fixture(path: Path, robot: Robot, f: FixtureFile, common: tuple[float, ...] | None) -> Fixture:
    key = f"fixtures.{f.name}.mount_deg" if f.mount_deg else "gauge.mount_deg"
    given = f.mount_deg or common
    mount = None if given is None else angles(path, robot, key, given)
    axis = _unit(path, f"fixtures.{f.name}.axis", f.axis)
    return Fixture(f.name, frozen(from_mm(f.position_mm)), axis, f.prior_mm * MM, mount)


def angles(path: Path, robot: Robot, key: str, value: tuple[float, ...] | None) -> Array:
    """Return the joint angles (N,) [rad] of the key ``key``.

    Raises:
        InputError: they are missing, not one a joint, or outside the limits.
    """
    if value is None:
        raise InputError(f"{path}: the key '{key}' is missing ({robot.n_joints} angles in degrees)")
    if len(value) != robot.n_joints:
        raise InputError(f"{path}: '{key}' has {len(value)} angles, but {robot.name} has {robot.n_joints} joints")
    q = from_deg(value)
    for i in np.flatnonzero((q < robot.q_lower) | (q > robot.q_upper)):
        low, up = np.rad2deg(robot.q_lower[i]), np.rad2deg(robot.q_upper[i])
        raise InputError(f"{path}: '{key}' has joint {i + 1} at {value[i]:g}°, outside its limits {low:g}° … {up:g}°")
    return frozen(q)


def _unit(path: Path, key: str, v: tuple[float, float, float]) -> Array:
    norm = float(np.linalg.norm(v))
    if norm < 1e-9:
        raise InputError(f"{path}: '{key}' = {list(v)} is no direction")
    return frozen(np.array(v) / norm)
