"""Writes the files of a finished plan."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import InputError
from planner.common.files import check_writing, encode_text, write_bytes, write_text, write_together
from planner.common.lazy_modules import pl
from planner.common.progress import Stages
from planner.motion.timing.trajectory import trajectory_csv as table_csv
from planner.motion.timing.trajectory import trajectory_table
from planner.programs.rendering import ProgramFile
from planner.session.movable_cell import cell_files
from planner.session.plan_types import SessionPlan

if TYPE_CHECKING:
    from planner.report.page import Report


def fill_plan(
    plan: SessionPlan, folder: Path, stages: Stages, report: Callable[[], Report], one_clock: bool = False
) -> None:
    """Write programs, ``trajectory.csv``, ``cell.toml``, ``report.html``, pictures, ``timings.json`` into a folder.

    Args:
        plan: what is driven.
        folder: where to.
        stages: they keep the seconds.
        report: makes the page; plotting is loaded by it, as other commands start quicker without.
        one_clock: whether the time of ``trajectory.csv`` goes on from course to course, else it begins anew.
    """
    with stages.stage("report"):
        page = report().with_identity(plan.cell)
        page.draw_beside()
        for file in (file for _, files in plan.programs for file in files):
            write_text(folder / file.name, file.text, file.encoding)
        write_text(folder / "trajectory.csv", trajectory_csv(plan, one_clock))
        write_cell(plan.cell, folder)
        page.write(folder)
    write_text(folder / "timings.json", json.dumps(stages.seconds, indent=1) + "\n")


def trajectory_csv(plan: SessionPlan, one_clock: bool) -> str:
    """What is driven with the gauge, pass after pass: t_s, q1_deg …, length_mm."""
    step = 0.05  # [s] of trajectory.csv
    frames, start = [], 0.0
    for course in plan.courses:
        length = partial(plan.cell.bar_length, mounting=course.mounting)
        start = start if one_clock else 0.0
        for one in course.passes:
            frame = trajectory_table(one.trajectory, step, length, plan.cell.robot.joint_columns("q"))
            frames.append(frame.with_columns(pl.col("t_s") + np.round(start, 6)))
            start += one.trajectory.duration_s + step
    return table_csv(pl.concat(frames))


def write_program_as(files: tuple[ProgramFile, ...], path: Path, force: bool = False) -> list[str]:
    """Write the first of ``files`` to ``path`` as given and the others beside it; return what a person must know.

    A companion of the same name takes the name of ``path`` where that differs from its own in nothing but case;
    else it keeps the name by which the program finds it. ``force``: files of others are written over.

    Raises:
        InputError: ``path`` is the name of one of the others, a device for several files, or cannot be written.
    """
    asked, path = path, _follow_link(path)
    first, *others = files
    legal = Path(first.name)
    targets = [path]
    for other in map(Path, (f.name for f in others)):
        same = other.stem == legal.stem and path.stem.lower() == legal.stem.lower()
        targets.append(path.with_name((path.stem if same else other.stem) + other.suffix))
    if len({t.name.lower() for t in targets}) < len(targets):
        raise InputError(f"{path}: this name is that of another file of the program; {first.name} starts it")
    check_writing(path, force=force)
    if len(files) > 1 and path.exists() and not path.is_file():
        raise InputError(f"{path}: is no plain file, and the program is {len(files)} files; name a file")
    texts = [(t, encode_text(t, f.text, f.encoding)) for t, f in zip(targets, files, strict=True)]
    write_together(texts, force=force)
    said = [f"{asked} is written; the controller takes it under the name {first.name}"]
    needed = [f"{target} is written too: {path.name} needs it beside it" for target in targets[1:]]
    return (said if path.name != first.name else []) + needed


def _follow_link(path: Path) -> Path:
    """Return the target of a symbolic link; the path itself if it is no link or leads nowhere."""
    try:
        return path.resolve() if path.is_symlink() else path
    except (OSError, RuntimeError):
        return path


def write_cell(cell: Cell, folder: Path) -> None:
    """Write ``cell.toml`` with all that it needs, so that the folder can be moved and read again."""
    for name, data in cell_files(cell).items():
        (folder / name).parent.mkdir(exist_ok=True)
        write_bytes(folder / name, data)
