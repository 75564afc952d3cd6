"""``identify()``: from the log of a run to a calibrated robot, and its folder."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.common.files import write_bytes, write_text
from planner.common.progress import Stages
from planner.identification.calibrated_robot import calibrated_files, calibrated_meshes
from planner.identification.calibration import Calibration
from planner.identification.pipeline import FitSettings, identify
from planner.identification.residual_table import residuals_csv
from planner.instruments.accuracy.precision import check_mastering
from planner.runs.loader import load_runs
from planner.runs.reference_readings import read_reference_readings
from planner.runs.run import Run
from planner.session.document import PlanDocument, check_run_of_plan, read_plan
from planner.tracing.trace import trace
from planner.workflow.unit_checks import check_unit
from planner.workflow.writing import draft_folder, move_all


def identify_runs(
    runs: Sequence[Path],
    cell: str,
    stages: Stages,
    plan: Path | None = None,
    validate: Path | None = None,
    settings: FitSettings | None = None,
    tracing: bool = True,
) -> Calibration:
    """Identify the robot of one or more measured runs.

    With ``tracing`` what the geometry leaves is traced to its causes. With a plan its validation poses are kept out of
    the fit and judged, unless ``validate`` names a run for that.

    Raises:
        InputError: a file is wrong, or run, cell and plan do not belong together.
        NoSolutionError: the fit does not come to rest.
    """
    where = load_cell(cell, planning=False)
    with stages.stage("reading"):
        run = _with_mastering_warnings(where, load_runs(runs, where.robot.n_joints), runs)
        other = None if validate is None else load_runs([validate], where.robot.n_joints)
        if plan is not None:
            run, kept_out = _split_by_plan(run, plan, read_plan(plan, "drives"), where.robot.name)
            other = other or kept_out
        for each in (run, other):
            if each is not None:
                check_unit(each, where)
    with stages.stage("identification") as progress:
        return identify(run, where, other, settings, lambda _: progress(0, 0), trace if tracing else None)


def _with_mastering_warnings(cell: Cell, run: Run, paths: Sequence[Path]) -> Run:
    """Return the run, warned where the indicators did not show at the master ball what they should."""
    if cell.gauge.head is None:
        return run
    checks = [
        m
        for m in (check_mastering(cell, read_reference_readings(path)) for path in paths)
        if m is not None and not m.good
    ]
    return replace(run, warnings=(*run.warnings, *(m.text() for m in checks)))


def _split_by_plan(run: Run, path: Path, plan: PlanDocument, robot: str) -> tuple[Run, Run | None]:
    """Return the run without the plan's validation poses, and these."""
    check_run_of_plan(run, path, plan, robot)
    if run.samples.pose is None:
        return run, None
    aside = np.isin(run.samples.pose, plan.ids("validate"))
    strange = np.setdiff1d(run.samples.pose[run.samples.pose >= 0], plan.ids())
    if len(strange):
        raise InputError(f"{run.name}: pose {strange[0]} is not in {path} (there: 0 … {max(plan.ids())})")
    _check_places(run, path, plan)
    if not aside.any() or aside.all():
        return run, None
    return run.take(~aside), replace(run.take(aside), name=f"{run.name}, validation poses")


def _check_places(run: Run, path: Path, plan: PlanDocument) -> None:
    """Refuse a run that measured a pose elsewhere than the plan has it: at another ball, fixture or tool point."""
    assert run.samples.pose is not None
    planned = {p.id: p for p in plan.poses}
    looks = (
        ("ball", run.readings.ball, run.balls), ("fixture", run.samples.place, run.places),
        ("point", run.samples.point, run.points),
    )  # fmt: skip
    for what, which, names in looks:
        if which is None or names == ("",):
            continue
        pairs, first = np.unique(np.stack([run.samples.pose, which]), axis=1, return_index=True)
        for k, (pose, at) in sorted(zip(first.tolist(), pairs.T.tolist(), strict=True)):
            wanted = getattr(planned[pose], what) if pose in planned else None
            if wanted and names[at] and names[at] != wanted:
                raise InputError(
                    f"{run.where(k)}: pose {pose} was measured at {what} '{names[at]}', but {path} has it at '{wanted}'"
                )


def write_identification(found: Calibration, folder: Path, stages: Stages) -> list[Path]:
    """Write ``identification.json``, ``residuals.csv``, ``report.html`` and, where the fit may be used, the robot.

    A fit that failed its own checks is reported with the reasons, but no robot is written.
    """
    # plotting: other commands start quicker without
    from planner.report.calibration_report import report_calibration

    with draft_folder(folder) as draft, stages.stage("report"):
        write_text(draft / "identification.json", found.to_json())
        write_text(draft / "residuals.csv", residuals_csv(found))
        report_calibration(found).write(draft)
        if not found.problems:
            _write_robot(found, draft)
        if found.problems:
            (folder / "robot.toml").unlink(missing_ok=True)
        return move_all(draft, folder)


def _write_robot(found: Calibration, draft: Path) -> None:
    for file, text in calibrated_files(found):
        write_text(draft / file, text)
    for file, data in calibrated_meshes(found):
        (draft / file).parent.mkdir(parents=True, exist_ok=True)
        write_bytes(draft / file, data)
