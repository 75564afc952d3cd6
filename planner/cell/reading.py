"""Reads a cell file into a :class:`Cell`, and checks what one key alone cannot tell.

Sections of a cell file that extensions declare, such as ``[[name]]``: how they are written, and what was read.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import create_model
from scipy.spatial.transform import Rotation

from planner.cell.cell import Cell
from planner.cell.file import CellFile
from planner.cell.fleet_file import with_fleet
from planner.cell.gauge import Gauge
from planner.cell.gauge_registry import gauge_kinds
from planner.cell.parts import BaseMounting, Cable, MotionSettings, PlanSettings
from planner.cell.places import (
    read_artifact_bodies,
    read_balls,
    read_fixtures,
    read_joint_angles,
    read_nests,
    read_tool,
)
from planner.cell.section_content import SectionContent
from planner.cell.section_registry import section_readers
from planner.common.errors import InputError, did_you_mean, read_together
from planner.common.extensions import section_owner
from planner.common.files import data_folder
from planner.common.schema import StrictModel, read_toml_content, validate
from planner.common.units import MM, MM_PER_MIN, Array, from_deg, read_only
from planner.kinematics.packages import named_packages
from planner.kinematics.robot import Priors, Robot
from planner.kinematics.robot_file import DRIVE_KEYS
from planner.kinematics.robot_reader import load_robot


@dataclass(frozen=True)
class SectionReader:
    """How the tables ``[[key]]`` of a cell file are read.

    Attributes:
        table: the keys of one table, with their defaults.
        read: makes what stands in the cell of the path of a cell file, the file, and its tables.
    """

    table: type[StrictModel]
    read: Callable[[Path, CellFile, Sequence[Any]], SectionContent]


def _load_reader(key: str) -> SectionReader:
    module, name = section_readers()[key].split(":")
    reader: SectionReader = getattr(import_module(module), name)
    return reader


def cell_file_of(content: object, where: str) -> CellFile:
    """Check what a cell file says; ``where`` names the file in the message.

    Raises:
        InputError: with the first wrong keys, or the extension that a section needs.
    """
    readers = section_readers()
    for key in content if isinstance(content, dict) else ():
        if key not in readers and (owner := section_owner(key)):
            raise InputError(f"{where}: [[{key}]] is read by the extension '{owner}', which is not installed here")
    return validate(content, _model_with(tuple(sorted(readers))), where)


def read_cell_file(path: Path) -> CellFile:
    """Read a cell file.

    Raises:
        InputError: it is missing, no TOML, a key is wrong, or no extension reads one of its sections.
    """
    return cell_file_of(read_toml_content(path), str(path))


class _ExtendedFile(CellFile):
    """A cell file with sections of extensions; pickled by their names, since its class is made where it is used."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the call that rebuilds the object (pickle)."""
        return _restore, (self.ADDED, self.__getstate__())


def _restore(keys: tuple[str, ...], state: dict[Any, Any]) -> CellFile:
    model = _model_with(keys)
    file = model.__new__(model)
    file.__setstate__(state)
    return file


@cache
def _model_with(keys: tuple[str, ...]) -> type[CellFile]:
    """Return the model of a cell file that may have these sections of extensions."""
    if taken := CellFile.model_fields.keys() & set(keys):
        raise InputError(f"an extension declares the section '{min(taken)}' of cell files, which the core has already")
    tables: dict[str, Any] = {key: (tuple[_load_reader(key).table, ...], ()) for key in keys}  # type: ignore[misc]
    model = create_model(CellFile.__name__, __base__=_ExtendedFile, **tables)
    model.ADDED = keys
    return model


def read_sections(path: Path, file: CellFile) -> Mapping[str, SectionContent]:
    """Return the contents of the extensions' sections by their keys; missing sections are left out.

    Raises:
        InputError: a key is wrong, missing, or contradicts another.
    """
    written = {key: rows for key in file.ADDED if (rows := getattr(file, key))}
    return {key: _load_reader(key).read(path, file, rows) for key, rows in written.items()}


NEAR_BASE_MM = 10.0  # [mm] a fixture whose coordinates are all smaller would stand inside the robot's base
SHORT_TOOL_MM = 1.0  # [mm] from flange to ball: no ball is that small
PRIORS_OF_CLASS = {
    "industrial": Priors(),
    # printed or plain parts to some millimetres, zeros by the middle of a stroke, plastic gears: as SO-101 states
    "hobby": Priors(length=2 * MM, angle=float(from_deg(2.0)), compliance=2e-3),
}  # of a robot's errors before any calibration, in place of what its file says


def check_units(path: Path, file: CellFile) -> None:
    """Refuse lengths that look like metres and angles that look like radians; zeros mean zero in any unit.

    Raises:
        InputError: naming the key, what was found and what it would be in the unit that is wanted.
    """
    narrow = 5.0  # [deg] no ball joint tilts so little, and no bar could be measured with one
    for f in file.fixtures:
        if max(map(abs, f.position_mm)) < NEAR_BASE_MM:
            _raise_metres(path, f"fixtures.{f.name}.position_mm", f.position_mm, "inside the robot's base")
    _check_placement(path, file)
    points = [(f"tool.points.{p.name}.map_mm", p.map_mm) for p in file.tool.points] if file.tool else []
    for key, point in [*([("tool.map_mm", file.tool.map_mm)] if file.tool else []), *points]:
        if np.linalg.norm(point) < SHORT_TOOL_MM:
            _raise_metres(path, key, point, f"less than {SHORT_TOOL_MM:g} mm from the flange")
    mounts = [(f"fixtures.{f.name}.mount_deg", f.mount_deg) for f in file.fixtures]
    for key, angles in [("home_deg", file.home_deg), ("gauge.mount_deg", file.gauge.mount_deg), *mounts]:
        if angles and _looks_like_radians(angles):
            _raise_radians(path, key, angles)
    for key, cone in (("fixture", file.gauge.cone_deg.fixture), ("map", file.gauge.cone_deg.map)):
        if cone < narrow:
            raise InputError(
                f"{path}: 'gauge.cone_deg.{key}' = {cone:g}° is less than a ball joint's {narrow:g}°: this looks "
                f"like radians; {cone:g} rad would be {np.rad2deg(cone):.4g}, and the key is in degrees"
            )


def _check_placement(path: Path, file: CellFile) -> None:
    """Refuse an artifact or tracker inside the robot's base, and balls that stand inside one another."""
    for key, placed in (("artifact", file.artifact), ("tracker", file.tracker)):
        if placed is not None and max(map(abs, placed.position_mm)) < NEAR_BASE_MM:
            _raise_metres(path, f"{key}.position_mm", placed.position_mm, "inside the robot's base")
    if len(file.balls) > 1 and np.ptp([b.position_mm for b in file.balls], axis=0).max() < NEAR_BASE_MM:
        last = file.balls[-1]
        _raise_metres(path, f"balls.{last.name}.position_mm", last.position_mm, "inside all the other balls")
    for ball in file.balls:
        if ball.radius_mm < 0.5:  # [mm] no ball of a gauge has so small a radius
            _raise_metres(path, f"balls.{ball.name}.radius_mm", (ball.radius_mm,), "smaller than any ball of a gauge")
        if max(map(abs, ball.position_mm)) < SHORT_TOOL_MM:
            _raise_metres(
                path, f"balls.{ball.name}.position_mm", ball.position_mm, f"less than {SHORT_TOOL_MM:g} mm from zero"
            )


def _looks_like_radians(angles: tuple[float, ...]) -> bool:
    """Tell whether all angles are within ±2π and at least half of those not zero are printed multiples of π/4."""
    as_printed = 6e-4  # [rad] what three printed digits leave open
    eighth = np.pi / 4  # [rad] robots wait at multiples of 45°
    turned = np.abs([a for a in angles if a != 0.0])
    if not len(turned) or turned.max() > 2 * np.pi + as_printed:
        return False
    multiple = np.abs(turned - eighth * np.maximum(np.round(turned / eighth), 1.0)) < as_printed
    return bool(2 * multiple.sum() >= len(turned))


def _raise_metres(path: Path, key: str, found: tuple[float, ...], where: str) -> None:
    if any(found):
        meant = [float(f"{1e3 * v:.6g}") for v in found]
        raise InputError(
            f"{path}: '{key}' = {list(found)} is {where}: these look like metres; in millimetres they would be {meant}"
        )


def _raise_radians(path: Path, key: str, found: tuple[float, ...]) -> None:
    meant = [float(f"{np.rad2deg(v):.4g}") for v in found]
    raise InputError(
        f"{path}: '{key}' = {list(found)} holds multiples of π/4: these look like radians; "
        f"in degrees they would be {meant}"
    )


def shipped_cells() -> tuple[str, ...]:
    """Names ``robot/cell`` of the cells that come with the planner."""
    paths = data_folder("robots").glob("*/cells/*.toml")
    return tuple(sorted(f"{p.parent.parent.name}/{p.stem}" for p in paths))


def load_cell(reference: str | Path, planning: bool = True) -> Cell:
    """Load a cell by path, or by ``robot/cell`` for a shipped one.

    With ``planning`` false only what identification needs must be there: the robot and the kind of gauge.

    Raises:
        InputError: no such cell, or its file (or the robot's) is wrong.

    Example:
        >>> load_cell("comau-nj130/edbb").home  # (N,) rad  # doctest: +SKIP
    """
    reference = str(reference)
    path = Path(reference)
    if path.suffix == ".toml" or os.path.isfile(path):
        return read_cell(path, path.stem, planning)
    robot, _, cell = reference.partition("/")
    shipped = data_folder("robots") / robot / "cells" / f"{cell}.toml"
    if not os.path.isfile(shipped):  # false for a name that no file can have
        known = list(shipped_cells())
        raise InputError(
            f"cell '{reference}': neither a file nor a shipped cell{did_you_mean(reference, known)} "
            "(edbb robots lists the shipped ones)"
        )
    return read_cell(shipped, reference, planning)


def read_cell(path: Path, name: str, planning: bool = True) -> Cell:
    """Read the cell file at ``path``, for planning with a length gauge or for identification with any.

    Raises:
        InputError: a key is wrong, missing, or contradicts another.
    """
    return cell_of(read_cell_file(path), path, name, planning)


def gauge_class(file: CellFile) -> type[Gauge]:
    """Return the class of the gauge that a cell's file names.

    Raises:
        TypeError: what is registered by that name is no gauge.
    """
    kind = gauge_kinds()[file.gauge.kind]
    if not issubclass(kind, Gauge):
        raise TypeError(f"gauge '{kind.kind}': {kind.__name__} must be a Gauge")
    return kind


def cell_of(file: CellFile, path: Path, name: str, planning: bool = True) -> Cell:
    """Return the cell that ``file`` says; paths in it count from the folder of ``path``, which messages name.

    Raises:
        InputError: a key is wrong, missing, or contradicts another.
    """
    gauge = gauge_class(file)
    if not gauge.reads_moving or "measure" not in file.motion.model_fields_set:  # or it rests, whatever the file says
        file = file.model_copy(update={"motion": file.motion.model_copy(update={"measure": gauge.usual_measure})})
    if planning:
        check_units(path, file)
    packages = named_packages(str(path), file.packages, path.parent)
    robot = load_robot(file.robot, path.parent, file.tip, file.plan.beta, packages, file.parked, file.base.link)
    if file.class_ is not None:
        robot = replace(robot, priors=PRIORS_OF_CLASS[file.class_])
    _, _, home, tool, instrument, places = read_together(
        lambda: _check_drives(robot) if planning else None,
        lambda: robot.check_meshes() if planning else None,
        lambda: _read_home(path, file, robot, planning),
        lambda: read_tool(path, file.tool, robot, planning),
        lambda: gauge.read(path, robot, file, planning),
        lambda: (
            gauge.read_places(path, robot, file) if planning else read_fixtures(path, robot, file, gauge.usual_set_up)
        ),
    )
    cell = Cell(
        name=name,
        robot=robot,
        home=home,
        tool=tool,
        gauge=instrument,
        fixtures=places,
        balls=read_balls(path, file),
        obstacles=tuple(b.body(f"obstacle {k + 1}", path.parent) for k, b in enumerate(file.obstacles)),
        motion=read_motion(file),
        cable=_read_cable(path, file, robot),
        base=BaseMounting(
            read_only(Rotation.from_euler("xyz", from_deg(file.base.rpy_deg)).as_matrix()),
            None if file.base.floor_mm is None else file.base.floor_mm * MM,
        ),
        controller=file.controller,
        plan=_read_plan_options(file),
        file=file,
        path=path,
        carrier=read_artifact_bodies(path, file),
        nests=read_nests(file),
        sections=read_sections(path, file),
    )
    return with_fleet(cell, None if file.prior is None else path.parent / file.prior.fleet)


def _read_home(path: Path, file: CellFile, robot: Robot, planning: bool) -> Array:
    if planning or file.home_deg is not None:
        return read_joint_angles(path, robot, "home_deg", file.home_deg, file.home_mm)
    return np.asarray(np.clip(0.0, robot.q_lower, robot.q_upper))


def _check_drives(robot: Robot) -> None:
    """Refuse to plan where the robot's file leaves out what a path must keep to."""
    lacking: dict[tuple[str, ...], list[int]] = {}
    for i in range(robot.n_joints):
        keys = (DRIVE_KEYS[key][int(robot.slides[i])] for key in ("limit", "speed"))
        parts = dict(zip(keys, (robot.q_upper, robot.speed), strict=True))
        if missing := tuple(key for key, values in parts.items() if np.isinf(values[i])):
            lacking.setdefault(missing, []).append(i)
    if lacking:
        said = (f"{_name_joints(own)} no {' and no '.join(keys)}" for keys, own in lacking.items())
        raise InputError(
            f"{robot.path}: {', '.join(said)}, which planning needs"
            + (_advise_drives(robot, lacking) if robot.convention == "urdf" else "")
        )


def _name_joints(own: Sequence[int]) -> str:
    numbers = [str(i + 1) for i in own]
    return f"joint {numbers[0]} has" if len(own) == 1 else f"joints {', '.join(numbers)} have"


def _advise_drives(robot: Robot, lacking: Mapping[tuple[str, ...], Sequence[int]]) -> str:
    """Return the lines of ``robot.toml`` that say what the URDF does not say of joints; ``lacking``: keys of which."""
    examples = {"limit_deg": "[-170, 170]", "speed_deg_s": "90", "limit_mm": "[0, 350]", "speed_mm_s": "70"}
    file = "" if robot.path.suffix == ".toml" else f' (which names it: urdf = "{robot.path.name}", tip = "{robot.tip}")'
    tables = {i: [f"{key} = {examples[key]}" for key in keys] for keys, own in lacking.items() for i in own}
    lines = (["[[joints]]", f'name = "{robot.joint_names[i]}"', *own] for i, own in sorted(tables.items()))
    return "\n".join([f"; say it in robot.toml{file}:", *(line for own in lines for line in own)])


def read_motion(file: CellFile) -> MotionSettings:
    """Return what ``[motion]`` of a cell file says, in SI units."""
    m = file.motion
    speed = m.tool_speed_mm_min * MM_PER_MIN
    return MotionSettings(
        m.measure,
        m.both_ways,
        speed,
        m.blend_mm * MM,
        m.clearance_mm * MM,
        m.dwell_s,
        m.settle_s,
        m.travel_percent / 100,
        m.order,
    )


def _read_cable(path: Path, file: CellFile, robot: Robot) -> Cable:
    for twist in file.cable.sums:
        far = [a for a in twist.axes if a > robot.n_joints]
        if far:
            raise InputError(f"{path}: cable.sums names axis {far[0]}, but {robot.name} has {robot.n_joints} joints")
    sums = tuple((tuple(a - 1 for a in t.axes), float(from_deg(t.limit_deg))) for t in file.cable.sums)
    spin = file.cable.tool_about_bar_deg
    return Cable(sums, None if spin is None else float(from_deg(spin)))


def _read_plan_options(file: CellFile) -> PlanSettings:
    p = file.plan
    free = frozenset(p.free)
    if file.gauge.zero == "known":
        free -= {"zero"}
    step = None if p.grid_step_deg is None else float(from_deg(p.grid_step_deg))
    chosen_by = p.aim, p.method
    return PlanSettings(
        free, p.poses, p.candidates, step, p.index, p.refine, p.repeat, p.validate_, p.effects, *chosen_by
    )
