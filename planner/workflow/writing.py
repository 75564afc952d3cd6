"""Writes a finished plan into its folder: all of it, or nothing."""

from __future__ import annotations

import json
import shutil
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import tomli_w

from planner.cell.cell import Cell
from planner.common.errors import InputError
from planner.common.files import data_folder, document_text, draft_folder, move_all, write_text
from planner.common.lazy_modules import LazyModule
from planner.common.progress import Stages
from planner.instruments.circular.plan import CircularPlan, circular_content
from planner.motion.timing.trajectory import trajectory_csv as table_csv
from planner.motion.timing.trajectory import trajectory_table
from planner.programs.rendering import ProgramFile
from planner.session.plan_record import plan_document
from planner.session.plan_types import Plan, Programs

if TYPE_CHECKING:
    import polars as pl
else:
    pl = LazyModule("polars")

SAMPLE = 0.05  # [s] of trajectory.csv


def write_plan(plan: Plan, folder: Path, stages: Stages) -> list[Path]:
    """Write ``plan.json``, programs, ``trajectory.csv``, ``cell.toml``, ``report.html``, pictures, ``timings.json``.

    Everything is written beside the folder first, then moved in: a failure leaves the folder as it was.
    """
    from planner.report.plan_report import report_plan  # matplotlib and plotly: other commands start quicker without

    with draft_folder(folder) as draft:
        with stages.stage("report"):
            write_driven(plan.cell, plan.programs, trajectory_csv(plan), draft)
            report_plan(plan).write(draft)
            write_text(draft / "plan.json", document_text(plan_document(plan).content()))
        return write_timings(stages, draft, folder)


def write_driven(cell: Cell, programs: Programs, trajectory: str, draft: Path) -> None:
    """Write what any plan has: its programs, the text of ``trajectory.csv``, and ``cell.toml``."""
    for _, files in programs:
        for file in files:
            write_text(draft / file.name, file.text, file.encoding)
    write_text(draft / "trajectory.csv", trajectory)
    write_text(draft / "cell.toml", cell_text(cell, draft))


def write_timings(stages: Stages, draft: Path, folder: Path) -> list[Path]:
    """Write ``timings.json``, the last file, and move all of a draft into its folder."""
    write_text(draft / "timings.json", json.dumps(stages.seconds, indent=1) + "\n")
    return move_all(draft, folder)


def write_program_as(files: tuple[ProgramFile, ...], path: Path) -> list[str]:
    """Write the first of ``files`` to ``path`` as given and the others beside it; return what a person must know.

    A companion of the same name takes the name of ``path`` where that differs from its own in nothing but case;
    else it keeps the name by which the program finds it.

    Raises:
        InputError: ``path`` is the name of one of the others, or cannot be written.
    """
    first, *others = files
    legal = Path(first.name)
    targets = [path]
    for other in map(Path, (f.name for f in others)):
        same = other.stem == legal.stem and path.stem.lower() == legal.stem.lower()
        targets.append(path.with_name((path.stem if same else other.stem) + other.suffix))
    if len({t.name.lower() for t in targets}) < len(targets):
        raise InputError(f"{path}: this name is that of another file of the program; {first.name} starts it")
    for target, file in zip(targets, files, strict=True):
        write_text(target, file.text, file.encoding)
    said = (
        [f"{path} is written; the controller takes it under the name {first.name}"] if path.name != first.name else []
    )
    return said + [f"{target} is written too: {path.name} needs it beside it" for target in targets[1:]]


def trajectory_csv(plan: Plan) -> str:
    """The driven trajectory of every fixture, one after the other: t_s, q1_deg …, length_mm."""
    texts = []
    for drive in plan.drives:
        length = partial(plan.cell.bar_length, fixture=drive.fixture)
        texts.append(table_csv(trajectory_table(drive.trajectory, SAMPLE, length)))
    head = texts[0].split("\n", 1)[0] + "\n"
    return head + "".join(t.split("\n", 1)[1] for t in texts)


def cell_text(cell: Cell, folder: Path) -> str:
    """The cell as it was planned; a robot that is not a shipped one is laid beside it."""
    content = cell.file.model_dump(mode="json", by_alias=True, exclude_none=True)
    if not cell.robot.path.is_relative_to(data_folder("robots")):
        shutil.copyfile(cell.robot.path, folder / cell.robot.path.name)
        content["robot"] = cell.robot.path.name
    return tomli_w.dumps(content)


def write_circular_plan(plan: CircularPlan, folder: Path, stages: Stages) -> list[Path]:
    """Write ``plan.json``, programs, ``trajectory.csv``, ``cell.toml``, ``report.html``, pictures, ``timings.json``.

    Everything is written beside the folder first, then moved in: a failure leaves the folder as it was.
    """
    # matplotlib: other commands start quicker without
    from planner.report.circular_plan_report import report_circular_plan

    with draft_folder(folder) as draft:
        with stages.stage("report"):
            write_driven(plan.cell, plan.programs, circular_trajectory_csv(plan), draft)
            report_circular_plan(plan).write(draft)
            write_text(draft / "plan.json", document_text(circular_content(plan)))
        return write_timings(stages, draft, folder)


def circular_trajectory_csv(plan: CircularPlan) -> str:
    """All passes one after the other, as they are driven with the bar on: t_s, q1_deg …, length_mm."""
    frames, start = [], 0.0
    for drive in plan.drives:
        length = partial(plan.cell.bar_length, fixture=drive.fixture)
        for one in drive.passes:
            frame = trajectory_table(one.trajectory, SAMPLE, length)
            frames.append(frame.with_columns(pl.col("t_s") + np.round(start, 6)))
            start += one.trajectory.duration_s + SAMPLE
    return table_csv(pl.concat(frames))
