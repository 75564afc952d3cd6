"""What an identification reads: runs, their cell, the poses of their plan that are kept out of the fit.

The runs of an identification, each with its own cell and plan: given with it, or lying beside it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from planner.accuracy.precision import check_mastering
from planner.accuracy.tracker_nests import compare_nest_distances
from planner.cell.cell import Cell
from planner.cell.fleet_file import with_fleet
from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.common.progress import Stages
from planner.common.result import Result
from planner.common.units import from_mm
from planner.documents.calibration import PlannedTargets
from planner.fit.run_setup import drop_unreadable, number_samples
from planner.identification.joint_sessions import MeasuredSession, join_sessions
from planner.kinematics.robot import Robot
from planner.model.own_priors import with_priors
from planner.runs.loader import load_runs, refuse_repeated_files
from planner.runs.run import NO_REFERENCE_READINGS, Run, read_reference_readings
from planner.session.document import PlanDocument, read_plan
from planner.simulation.simulated_run import SimulatedRun
from planner.workflow.core_calls import IdentifyCall
from planner.workflow.run_checks import cell_of_run, check_unit, settle_angles, split_by_plan

if TYPE_CHECKING:
    from planner.workflow.plan_results import PlanResult


T = TypeVar("T")
CellOf = Cell | Path | str
PLAN, CELL = "plan.json", "cell.toml"  # beside a run, where it was measured


@dataclass(frozen=True)
class RunSource:
    """A file of a run, with the cell and the plan that it was measured by."""

    path: Path
    cell: "CellOf | None" = None
    plan: "PlanResult | Path | str | None" = None

    @property
    def plan_beside(self) -> Path | None:
        """The plan that lies in the folder of the run, where there is one."""
        path = self.path.parent / PLAN
        return path if path.is_file() else None


def values_by_run(value: object, count: int, option: str) -> list[object]:
    """Return one value for each of ``count`` runs: one for all, or one each in their order.

    Raises:
        InputError: another number of values.
    """
    values = list(value) if isinstance(value, list | tuple) else [value]
    if len(values) in (0, 1):
        return (values or [None]) * count
    if len(values) != count:
        raise InputError(
            f"{option} is given {len(values)} times for {count} runs: give it once for all, or once for each run in "
            "their order"
        )
    return values


def run_sources(runs: Sequence[Path | str], cell: object, plan: object) -> tuple[RunSource, ...]:
    """Return the files of an identification, each with what is given for it."""
    cells, plans = (values_by_run(v, len(runs), o) for v, o in ((cell, "--cell"), (plan, "--plan")))
    return tuple(
        RunSource(Path(r), c, p)  # type: ignore[arg-type]
        for r, c, p in zip(runs, cells, plans, strict=True)
    )


def are_sessions(sources: Sequence[RunSource], *given: object) -> bool:
    """Tell whether the runs are several sessions: of cells or plans of their own, ``given`` or lying beside each."""
    if len(sources) < 2:
        return False
    if any(isinstance(value, list | tuple) and len(value) > 1 for value in given):
        return True
    first = sources[0]
    own = {(str(s.cell), str(s.plan)) for s in sources}
    plans = {p for s in sources if (p := s.plan_beside) is not None}
    return len(own) > 1 or (first.plan is None and (first.cell is None or len(plans) > 1))


def load_sessions(sources: Sequence[RunSource]) -> tuple[Run, Cell, Run | None]:
    """Return all runs as one, their common cell, and the validation poses of their plans, which no fit sees.

    Raises:
        InputError: a file is wrong, a run belongs to another plan or robot, or nothing says where it was measured.
    """
    run, cell, kept_out, _ = load_planned_sessions(sources)
    return run, cell, kept_out


def load_planned_sessions(
    sources: Sequence[RunSource],
) -> tuple[Run, Cell, Run | None, tuple[PlanDocument | None, ...]]:
    """Return what :func:`load_sessions` does, and the plan of each session.

    Raises:
        InputError: as there.
    """
    refuse_repeated_files([s.path for s in sources])
    names = _session_names([s.path for s in sources])
    loaded = [_load(source, name) for source, name in zip(sources, names, strict=True)]
    run, cell = join_sessions([session for session, _, _ in loaded])
    run = number_samples(run)
    aside = np.concatenate([mask for _, mask, _ in loaded])
    plans = tuple(plan for _, _, plan in loaded)
    if not aside.any():
        return run, cell, None, plans
    kept_out = replace(run.take(aside), name=f"{run.name}, validation poses")
    return run.take(~aside), cell, kept_out, plans


def _load(source: RunSource, name: str) -> tuple[MeasuredSession, np.ndarray, PlanDocument | None]:
    """Read a run with its cell; tell which of its samples are at validation poses of its plan, and which plan it is."""
    path, plan = _plan_of(source)
    cell = _session_cell(source, path)
    run = settle_angles(load_runs([source.path], cell.robot.n_joints, cell.robot.axes_of), cell.robot)
    cell.check_robot(run)
    if plan is None and source.plan_beside is not None:
        beside = read_plan(source.plan_beside, "drives")
        if run.plan_id in (None, beside.plan_id):
            path, plan = source.plan_beside, beside
    check_unit(run, cell)
    run = number_samples(drop_unreadable(cell, run))
    aside = np.zeros(len(run), dtype=bool)
    if plan is not None:
        _, kept_out = split_by_plan(run, path, plan, cell)
        if kept_out is not None:
            aside = np.isin(np.asarray(run.samples.number), np.asarray(kept_out.samples.number))
    # counted anew once all are one run
    run = replace(run, samples=replace(run.samples, number=None))
    if name != source.path.stem:  # several files are called alike
        run = replace(run, files=(f"{source.path.resolve().parent.name}/{source.path.name}",))
    planned = run.plan_id if plan is None else plan.plan_id
    return MeasuredSession(name, run, cell, cell.gauge.mounting or planned or ""), aside, plan


def _plan_of(source: RunSource) -> tuple[Path, PlanDocument | None]:
    """Return the plan that is given for a run, and where it lies."""
    if source.plan is None:
        return Path(PLAN), None
    if isinstance(source.plan, Path | str):
        return Path(source.plan), read_plan(Path(source.plan), "drives")
    return Path(PLAN), source.plan.document()


def _session_cell(source: RunSource, plan: Path) -> Cell:
    """Return the cell that is given for a run, else the one beside its plan, else beside the run itself.

    Raises:
        InputError: there is none.
    """
    if isinstance(source.cell, Cell):
        return source.cell
    if source.cell is not None:
        return load_cell(str(source.cell), planning=False)
    if source.plan is not None and not isinstance(source.plan, Path | str):
        return source.plan.plan.cell
    beside = (plan if source.plan is not None else source.path).parent / CELL
    if not beside.is_file():
        raise InputError(
            f"{source.path}: no {CELL} lies beside it: give --cell once for each run in their order, or keep each run "
            "in the folder of its plan"
        )
    return load_cell(str(beside), planning=False)


def _session_names(paths: Sequence[Path]) -> list[str]:
    """Return a name for each session: of its file, of its folder where files are called alike, or of both."""
    resolved = [p.resolve() for p in paths]
    for i, path in enumerate(resolved):
        if path in resolved[:i]:
            raise InputError(f"{paths[i]} is given twice; the same samples would count as new ones")
    for name in (lambda p: p.stem, lambda p: p.parent.name, lambda p: f"{p.parent.name}/{p.stem}"):
        names = [name(p) for p in resolved]
        if len(set(names)) == len(names):
            return names
    return [f"{k}" for k in range(1, len(paths) + 1)]


def single_value(value: "T | Path | str | Sequence[T | Path | str] | None", option: str) -> "T | Path | str | None":
    """Return the value of an option that is given once.

    Raises:
        InputError: it is given more often.
    """
    if isinstance(value, str) or not isinstance(value, Sequence):
        return value
    if len(value) > 1:
        raise InputError(f"{option} is given {len(value)} times for one run")
    return value[0] if value else None


Runs = Run | Path | str | Sequence[Path | str]
"""One run or several, loaded or by path."""


@dataclass(frozen=True)
class MeasuredRuns:
    """All that an identification needs of files.

    Attributes:
        asked: by whom it is wanted.
        run: one, of all files.
        cell: where it was measured, with the priors that were given.
        validation: poses that no fit sees.
        foreseen: what each plan has foreseen after each pose [m].
        planned: what the one plan expected of the robot's targets; ``None`` where that is not known.
        stages: what is said of its progress, and the seconds that each step took.
    """

    asked: IdentifyCall
    run: Run
    cell: Cell
    validation: Run | None
    foreseen: tuple[tuple[float, ...], ...]
    stages: Stages
    planned: PlannedTargets | None = None


def read_measured_runs(asked: IdentifyCall) -> MeasuredRuns:
    """Read all that an identification needs of files.

    Raises:
        InputError: a file is wrong, or run, cell and plan do not belong together.
    """
    measured = asked.runs.run if isinstance(asked.runs, Result) else asked.runs
    if not isinstance(measured, Run | Path | str):
        sources = run_sources(measured, asked.cell, asked.plan)
        if are_sessions(sources, asked.cell, asked.plan):
            return _read_sessions(sources, asked)
    given, plan = single_value(asked.cell, "--cell"), _plan_of_poses(single_value(asked.plan, "--plan"))
    cell = with_priors(with_fleet(_cell_of(given, plan), asked.fleet), asked.priors)
    stages, foreseen, planned = Stages(asked.progress), tuple[float, ...](), None
    with stages.stage("reading"):
        run = _with_reference_warnings(cell, load_any(measured, cell.robot), measured)
        other = None if asked.validate is None else load_any(asked.validate, cell.robot)
        if plan is not None:
            path = Path(plan) if isinstance(plan, Path | str) else Path("plan.json")
            document = read_plan(path, "drives") if isinstance(plan, Path | str) else plan.document()
            run, kept_out = split_by_plan(number_samples(run), path, document, cell)
            run = replace(run, plan_id=document.plan_id)
            other, foreseen, planned = other or kept_out, _foreseen_errors(document), _planned_targets(document)
        for each in (run, other):
            if each is not None:
                check_unit(each, cell)
        run, other = drop_unreadable(cell, run), None if other is None else drop_unreadable(cell, other)
        if other is not None:  # what was cut out of the poses kept apart is said as what was cut out of the others
            run = replace(run, warnings=tuple(dict.fromkeys((*run.warnings, *other.warnings))))
    return MeasuredRuns(asked, run, cell, other, (foreseen,) if foreseen else (), stages, planned)


def _read_sessions(sources: Sequence[RunSource], asked: IdentifyCall) -> MeasuredRuns:
    """Read several sessions, each with its own fixtures and gauge."""
    stages = Stages(asked.progress)
    with stages.stage("reading"):
        run, cell, kept_out, plans = load_planned_sessions(sources)
        cell = with_priors(with_fleet(cell, asked.fleet), asked.priors)
        judge = asked.validate
        other = kept_out if judge is None else drop_unreadable(cell, load_any(judge, cell.robot))
    foreseen = tuple(() if plan is None else _foreseen_errors(plan) for plan in plans)
    return MeasuredRuns(asked, run, cell, other, foreseen, stages)


def _plan_of_poses(plan: object) -> "PlanResult | Path | str | None":
    """Return the plan that was measured; one of another kind, or of poses alone, is evaluated elsewhere.

    Raises:
        InputError: it is no plan of poses.
    """
    from planner.workflow.plan_results import PlanResult

    if plan is None or isinstance(plan, PlanResult | Path | str):
        return plan
    raise InputError(f"plan: a plan of poses, or the path of its plan.json, is needed, not a {type(plan).__name__}")


def _cell_of(cell: Cell | Path | str | None, plan: "PlanResult | Path | str | None") -> Cell:
    """Return the cell that is given, else that of the plan, read or not.

    Raises:
        InputError: neither is given, or the file is wrong.
    """
    if plan is None or isinstance(plan, Path | str):
        return cell_of_run(cell, plan)
    return cell_of_run(plan.plan.cell if cell is None else cell, None)


def load_any(runs: Runs, robot: Robot) -> Run:
    """Return one run: the one that is given, or that of the files that are given; angles within the joints' limits."""
    if not isinstance(runs, Run):
        paths = [Path(runs)] if isinstance(runs, Path | str) else [Path(r) for r in runs]
        runs = load_runs(paths, robot.n_joints, robot.axes_of)
    return settle_angles(runs, robot)


def _foreseen_errors(document: PlanDocument) -> tuple[float, ...]:
    """Return the error that a plan has foreseen after each pose [m]; empty where it has foreseen none."""
    after = () if document.foresight is None else document.foresight.after_mm
    return () if any(v is None for v in after) else tuple(float(from_mm(v)) for v in after if v is not None)


def _planned_targets(document: PlanDocument) -> PlannedTargets | None:
    """Return what a plan expects of the robot's targets; ``None`` where it says nothing of them."""
    if document.foresight is None or document.foresight.within_mm is None:
        return None
    return PlannedTargets(float(from_mm(document.foresight.within_mm)), len(document.ids("calibrate")))


def _with_reference_warnings(cell: Cell, run: Run, source: Runs) -> Run:
    """Return the run, warned where indicators at the master ball, or nests, were not read as they should."""
    if cell.gauge.mastered_reading(cell) is None and not cell.nests:
        return run
    if isinstance(source, Run):
        readings = [source.beside] if isinstance(source, SimulatedRun) else []
    else:
        paths = [source] if isinstance(source, Path | str) else source
        readings = [read_reference_readings(Path(path)) for path in paths]
    checks = [m for m in (check_mastering(cell, r) for r in readings) if m is not None and not m.good]
    scales = (compare_nest_distances(cell, r) for r in readings or (NO_REFERENCE_READINGS,))
    return replace(run, warnings=(*run.warnings, *(m.text() for m in checks), *(s for s in scales if s)))
