"""The results of planning: a session of poses, a circular test, and the runs and programs that are made of them.

Writes the files of a finished plan.
"""

from __future__ import annotations

import json
import re
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from planner.cell.cell import Cell
from planner.common.console import as_word
from planner.common.content_hashes import HandEdit
from planner.common.errors import InputError
from planner.common.files import check_writing, encode_text, write_bytes, write_text, write_together
from planner.common.lazy_modules import pl
from planner.common.numbers import number_of
from planner.common.progress import Stages
from planner.common.result import FolderResult, Plot, Result
from planner.common.summary import Summary
from planner.motion.timing.trajectory import trajectory_csv as table_csv
from planner.motion.timing.trajectory import trajectory_table
from planner.next_session.planned_poses import evaluation_with_runs_before
from planner.next_session.remaining_errors import RemainingErrors
from planner.programs.rendering import ProgramFile
from planner.runs.writer import run_text, save_run
from planner.session.document import PlanDocument, PlanHeader
from planner.session.evaluations import evaluation_of
from planner.session.movable_cell import cell_files
from planner.session.plan_record import UnprovenPoses, plan_document
from planner.session.plan_types import Plan, Programs, SessionPlan
from planner.simulation.simulated_run import SimulatedRun
from planner.workflow.plan_overview import plan_overview, unproven_overview

if TYPE_CHECKING:
    from planner.report.page import Report


def fill_plan(
    plan: SessionPlan, folder: Path, stages: Stages, report: Callable[[], Report], one_clock: bool = False
) -> None:
    """Write programs, ``trajectory.csv``, ``cell.toml``, ``report.html``, ``timings.json`` into a folder.

    Args:
        plan: what is driven.
        folder: where to.
        stages: they keep the seconds.
        report: makes the page; plotting is loaded by it, as other commands start quicker without.
        one_clock: whether the time of ``trajectory.csv`` goes on from course to course, else it begins anew.
    """
    with stages.stage("report"):
        page = report().with_identity(plan.cell)
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


@dataclass(frozen=True)
class SessionResult(FolderResult):
    """A planned session; ``cut_short``: what a limit of time left undone."""

    main_file = "plan.json"

    kind: ClassVar[str] = ""
    """``kind`` in ``plan.json``; empty for poses."""
    one_clock: ClassVar[bool] = False
    """Whether the time of ``trajectory.csv`` goes on from fixture to fixture."""

    plan: SessionPlan
    stages: Stages = field(default_factory=Stages)
    cut_short: tuple[str, ...] = ()

    @property
    def hand_edits(self) -> tuple[HandEdit, ...]:
        """Return what a person changed in the robot's files."""
        return self.plan.cell.robot.hand_edits

    @abstractmethod
    def document(self) -> PlanHeader:
        """Return what ``plan.json`` holds."""

    @abstractmethod
    def report(self) -> Report:
        """Return the page of the plan."""

    def content(self) -> Mapping[str, Any]:
        """Return what ``plan.json`` says."""
        return self.document().content()

    def fill(self, draft: Path) -> None:
        """Write programs, ``trajectory.csv``, ``cell.toml``, the report and its pictures."""
        fill_plan(self.plan, draft, self.stages, self.report, self.one_clock)

    def files(self, folder: Path) -> str:
        """Name the programs and what every plan has."""
        return plan_files(self.plan.programs)


@dataclass(frozen=True)
class PlanResult(SessionResult):
    """A planned session of poses.

    Attributes:
        plan: poses ``choice.q`` (n, N) [rad], indices, certificate, drives and programs.
        stages: seconds of each step.

    Example:
        >>> session.plan.choice.q.shape  # (60, 6), rad  # doctest: +SKIP
        >>> session.write("session")  # doctest: +SKIP
    """

    plan: Plan

    def next_step(self, folder: Path) -> str:
        """Say how the session is measured and evaluated."""
        plan = folder / "plan.json"
        measure = self.plan.cell.gauge.measuring_command.replace("PLAN", as_word(plan))
        expected = self.plan.expected_error
        if expected is not None and isinstance(expected.unknown, RemainingErrors):
            return f"{measure}\n{evaluation_with_runs_before(folder / 'run.csv')}"
        return f"{measure}\n{self.evaluation(plan)}"

    def evaluation(self, plan: Path) -> str:
        """Return the command that evaluates the run of ``plan``."""
        calibrates = any(v.role == "calibrate" for d in self.plan.drives for v in d.visits)
        return evaluation_of("run.csv", plan, None, calibrates)

    def overview(self) -> Summary:
        """Return the overview: the drive, the error before and after, what would help and what stays unseen."""
        return plan_overview(self.plan)

    def document(self) -> PlanDocument:
        """Return what ``plan.json`` holds."""
        return plan_document(self.plan)

    def report(self) -> Report:
        """Return the page of the plan and its pictures."""
        from planner.report.plan_report import report_plan

        return report_plan(self.plan)

    def preview(self) -> Plot:
        """Return the expected error over the number of poses; else the criterion over it, or what the poses teach."""
        expected = "foresight" if self.plan.expected_error else "index_curve"
        return self.plot(expected if self.plan.expected_error or self.plan.curve else "parameters")

    def plot(self, name: str) -> Plot:
        """Return one of the report's charts by its name.

        Raises:
            InputError: no such chart.
        """
        from planner.report.matplotlib_backend import find_plot

        return find_plot(self.report().charts, name)


@dataclass(frozen=True)
class PosesResult(FolderResult):
    """Poses that a limit of time left without a proven path; ``cut_short``: what it left undone."""

    main_file = "plan.json"
    poses: UnprovenPoses
    cut_short: tuple[str, ...]

    @property
    def hand_edits(self) -> tuple[HandEdit, ...]:
        """Return what a person changed in the robot's files."""
        return self.poses.cell.robot.hand_edits

    def overview(self) -> Summary:
        """Return the overview: poses, their certificate, and what is not proven."""
        return unproven_overview(self.poses)

    def content(self) -> Mapping[str, Any]:
        """Return what ``plan.json`` says."""
        return self.poses.record()

    def fill(self, draft: Path) -> None:
        """Write ``cell.toml``; the program of an earlier plan in the folder is cleared."""
        write_cell(self.poses.cell, draft)

    def files(self, folder: Path) -> str:
        """Name what is there."""
        return "plan.json (poses alone), cell.toml"


@dataclass(frozen=True)
class SimulationResult(Result):
    """A run that nobody measured; the errors behind it stand in its comments.

    Attributes:
        run: as one that was measured; ``run.truth`` has its errors as keys of ``TRUTH.toml``.

    Example:
        >>> made = simulate("session/plan.json", seed=3)  # doctest: +SKIP
        >>> made.run.readings.length  # (n,) m  # doctest: +SKIP
        >>> made.write("run.csv")  # doctest: +SKIP
    """

    run: SimulatedRun

    def overview(self) -> Summary:
        """Return how many samples there are, and what to know."""
        return Summary(f"{self.run.name}: {number_of(len(self.run), 'sample')}", notes=self.run.warnings)

    def content(self) -> Mapping[str, Any]:
        """Return the true errors behind the run, and its warnings."""
        run = self.run
        return {
            "run": run.name,
            "plan_id": run.plan_id,
            "robot": run.robot,
            "n_samples": len(run),
            "truth": list(run.truth),
            "warnings": list(run.warnings),
        }

    def text(self) -> str:
        """Return the run as CSV, with what is true of it in comments."""
        return run_text(self.run, self.run.comments())

    def write(self, folder: Path | str, force: bool = False) -> list[Path]:
        """Write the run into a file, as CSV or Parquet by the name's ending; ``force``: over a file of others too."""
        path = Path(folder)
        if path.suffix.lower() == ".csv":
            write_text(path, self.text(), force=force)
        else:
            save_run(self.run, path, force)
        return [path]


@dataclass(frozen=True)
class ExportResult:
    """A robot program: the file that starts it, and those that it needs beside it.

    Attributes:
        programs: name and text of each file.
        notes: what a person should know.

    Example:
        >>> export("session/plan.json", dialect="rapid").write("session.mod")  # doctest: +SKIP
    """

    programs: tuple[ProgramFile, ...]
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Name the files and their lines: their texts are long."""
        shown = 3  # files that are named
        files = ", ".join(f"{p.name} ({len(p.text.splitlines())} lines)" for p in self.programs[:shown])
        more = f" and {len(self.programs) - shown} more" if len(self.programs) > shown else ""
        return f"<ExportResult: {files}{more}>"

    def write(self, path: Path | str, force: bool = False) -> list[str]:
        """Write the program to ``path`` and the others beside it; returned is what a person must know of that.

        ``force``: over files of others too.
        """
        return write_program_as(self.programs, Path(path), force)


def plan_files(programs: Programs) -> str:
    """Name the files of a plan: first the programs, one of many parts in one go, then what every plan has."""
    shown: list[str] = []
    for (stem, suffix), group in groupby((f.name for _, files in programs for f in files), key=_numbered_stem):
        names: Sequence[str] = list(group)
        shown += [f"{names[0]} … {names[-1][len(stem) :]}"] if suffix and len(names) > 2 else names
    return f"{', '.join([*shown, 'plan.json'])}, cell.toml, trajectory.csv, report.html"


def _numbered_stem(name: str) -> tuple[str, str]:
    """What the parts of a split program have in common, stem and suffix; of another file its name."""
    found = re.fullmatch(r"(.*_)\d{3}(\.\w+)", name)
    return (found[1], found[2]) if found else (name, "")
