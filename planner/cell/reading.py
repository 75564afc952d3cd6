"""Reads a cell file into a :class:`Cell`, and checks what one key alone cannot tell."""

import os
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from planner.cell.cell import (
    BaseMounting,
    Cable,
    Cell,
    MotionSettings,
    PlanSettings,
)
from planner.cell.circles import Circle, read_circles
from planner.cell.file import CellFile
from planner.cell.gauge import Gauge
from planner.cell.gauge_registry import gauge_kinds
from planner.cell.places import (
    read_artifact_bodies,
    read_balls,
    read_fixtures,
    read_joint_angles,
    read_nests,
    read_tool,
)
from planner.cell.unit_checks import check_units
from planner.common.errors import InputError, did_you_mean
from planner.common.files import data_folder
from planner.common.schema import read_toml
from planner.common.units import MM, MM_PER_MIN, from_deg, from_mm, read_only
from planner.kinematics.robot import Robot
from planner.kinematics.robot_reader import load_robot


def shipped_cells() -> tuple[str, ...]:
    """Names ``robot/cell`` of the cells that come with the planner."""
    paths = data_folder("robots").glob("*/cells/*.toml")
    return tuple(sorted(f"{p.parent.parent.name}/{p.stem}" for p in paths))


def load_cell(reference: str | Path, planning: bool = True) -> Cell:
    """Load a cell by path, or by ``robot/cell`` for a shipped one.

    With ``planning`` false only what identification needs must be there: the robot and the kind of gauge.

    Raises:
        InputError: no such cell, or its file (or the robot's) is wrong.
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
            f"(shipped: {', '.join(known)})"
        )
    return read_cell(shipped, reference, planning)


def read_cell(path: Path, name: str, planning: bool = True) -> Cell:
    """Read the cell file at ``path``, for planning with a length gauge or for identification with any.

    Raises:
        InputError: a key is wrong, missing, or contradicts another.
    """
    return cell_of(read_toml(path, CellFile), path, name, planning)


def gauge_class(file: CellFile) -> type[Gauge]:
    """Return the class of the gauge that a cell's file names."""
    return gauge_kinds()[file.gauge.kind]


def cell_of(file: CellFile, path: Path, name: str, planning: bool = True) -> Cell:
    """Return the cell that ``file`` says; paths in it count from the folder of ``path``, which messages name.

    Raises:
        InputError: a key is wrong, missing, or contradicts another.
    """
    gauge = gauge_class(file)
    if planning:
        check_units(path, file)
    robot = load_robot(file.robot, path.parent, file.tip, file.plan.beta)
    if planning:
        _check_drives(robot)
    places = gauge.read_places(path, robot, file) if planning else read_fixtures(path, robot, file)
    home = np.clip(0.0, robot.q_lower, robot.q_upper)
    if planning or file.home_deg is not None:
        home = read_joint_angles(path, robot, "home_deg", file.home_deg)
    return Cell(
        name=name,
        robot=robot,
        home=home,
        tool=read_tool(path, file.tool, robot, planning),
        gauge=gauge.read(path, robot, file, planning),
        fixtures=places,
        balls=read_balls(path, file),
        obstacles=tuple(b.body(f"obstacle {k + 1}", path.parent) for k, b in enumerate(file.obstacles)),
        motion=_read_motion(file),
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
        circles=_read_circles(path, file),
    )


def _check_drives(robot: Robot) -> None:
    """Refuse to plan where the robot's file leaves out what a path must keep to."""
    parts = (
        ("limit_deg", robot.q_upper),
        ("speed_deg_s", robot.speed),
        ("acceleration_deg_s2", robot.acceleration),
        ("jerk_deg_s3", robot.jerk),
    )
    for key, values in parts:
        for i in np.flatnonzero(np.isinf(values)):
            raise InputError(f"{robot.path}: joint {i + 1} has no {key}, which planning needs")


def _read_circles(path: Path, file: CellFile) -> tuple[Circle, ...]:
    if not file.circles:
        return ()
    if not file.fixtures or file.gauge.length_mm is None:
        raise InputError(f"{path}: [[circles]] need a [[fixtures]] table and 'gauge.length_mm'")
    loaded = [c for c in file.circles if c.loads_N]
    if loaded and not gauge_class(file).is_loaded:
        raise InputError(f"{path}: 'circles.loads_N' needs gauge.kind = 'ldbb', found '{file.gauge.kind}'")
    shortest, longest = file.gauge.length_mm
    fixtures = {f.name: read_only(from_mm(f.position_mm)) for f in file.fixtures}
    speed = file.motion.tool_speed_mm_min * MM_PER_MIN
    return read_circles(path, file.circles, fixtures, (shortest * MM, longest * MM), speed)


def _read_motion(file: CellFile) -> MotionSettings:
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
        m.tour_cost,
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
    return PlanSettings(free, p.poses, p.candidates, step, p.index, p.refine, p.repeat, p.validate_, p.effects, p.aim)
