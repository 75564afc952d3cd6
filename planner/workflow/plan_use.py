"""What is made later of ``plan.json`` and the cell beside it: programs, simulated runs, runs of a controller's log."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from planner.cell.cell import Cell
from planner.cell.reading import load_cell
from planner.common.calls import called_with
from planner.common.determinism import on_one_thread
from planner.common.errors import InputError
from planner.common.schema import read_json, validate
from planner.gauges.vision.images import BoardInImages, find_corners
from planner.kinematics.robot import Robot
from planner.kinematics.robot_reader import load_robot
from planner.motion.planning_packages import has_judges
from planner.programs.controller_axes import axis_convention
from planner.programs.dialect import PathForm, dialect_names, load_dialect
from planner.programs.instructions import Program
from planner.programs.verification import import_map
from planner.runs.column_map import ColumnMap
from planner.runs.image_table import run_of_images
from planner.runs.proposed_map import write_proposed_map
from planner.runs.run import Run, Samples
from planner.runs.traces import import_by_map, import_run, is_trace_of
from planner.session.document import read_dialects, read_plan
from planner.session.evaluations import simulated_run_warnings
from planner.session.judgement import judge_plan
from planner.session.neutral_program import driven_form, session_program, write_session
from planner.session.plan_types import Plan
from planner.session.planned_session import PlannedSession, load_session
from planner.simulation.simulated_run import SAMPLE_RATE, planned_samples, simulate_run
from planner.simulation.truth import draw_expected_truth, read_truth
from planner.workflow.core_calls import ExportCall, ImportCall, SimulateCall
from planner.workflow.plan_kinds import DrivenPlan, PlanKind, find_plan_kind
from planner.workflow.plan_results import ExportResult, PosesResult, SessionResult, SimulationResult

NOT_PROVEN_ANEW = "its path was not proven anew, as no collision engine is installed here"


@called_with(ExportCall)
@on_one_thread
def export(asked: ExportCall) -> ExportResult:
    """Return the program of the plan at a path in any dialect.

    Raises:
        InputError: no plan, no cell beside it, or the two do not belong together; an unknown dialect, or one of a
            controller whose axes the robot's file does not describe.
        NoSolutionError: its drive is not proven.
        MissingProgramError: no collision engine is installed here, and it is not what was proven when it was planned.

    Example:
        >>> export("session/plan.json", dialect="rapid").write("session.mod")  # doctest: +SKIP
    """
    path, dialect, name = Path(asked.plan), asked.dialect, asked.name
    form = driven_form(dialect)
    planned = kind.load_maker().load(path) if (kind := _kind_of(path)) else load_session(path, "exported", check=True)
    _ = axis_convention(planned.cell.robot, load_dialect(dialect))
    program = _program_of(path, planned, form)
    notes = judge_plan(path, planned.cell, program, planned.notes, form in _proven_forms(path))
    changed = " ".join(n.replace(str(path), "the plan") for n in notes)
    stem = f"{planned.cell.robot.name}_{planned.plan_id}" if name == "-" else Path(name).stem
    return ExportResult(write_session(planned.cell, replace(program, changed=changed), dialect, stem), notes)


@called_with(SimulateCall)
@on_one_thread
def simulate(asked: SimulateCall) -> SimulationResult:
    """Simulate the measured run of a plan, on a robot with the errors of a file ``truth``, or with drawn ones.

    A smoke test of the chain, as planner and identifier share its model; the run carries what is true. ``truth`` may be
    a simulated run, for its robot; ``change`` (``KEY=VALUE``) is added to one of its errors.

    Raises:
        InputError: no plan, no cell beside it, the two do not belong together, or a truth that is wrong.

    Example:
        >>> simulate("session/plan.json", truth={"theta2_deg": 0.1}, seed=3).run  # doctest: +SKIP
    """
    plan, truth, change, seed = asked.plan, asked.truth, asked.change, asked.seed
    drawn = truth is None
    driven = _drive_of_file(Path(plan), drawn) if isinstance(plan, Path | str) else _drive_of(plan, drawn)
    cell, samples = driven.cell, driven.samples
    if change and drawn:
        raise InputError("a change is of a known robot: give its truth too (--truth), a file or its simulated run")
    known = (
        draw_expected_truth(cell, seed, samples)
        if truth is None
        else read_truth(truth if isinstance(truth, Mapping) else Path(truth), cell, samples, change)
    )
    run = simulate_run(cell, driven.plan_id, samples, known, seed)
    warnings = (*run.warnings, *driven.notes, *cell.gauge.centring_warnings(cell, samples, run))
    return SimulationResult(replace(run, warnings=warnings))


@dataclass(frozen=True)
class _Drive:
    """A plan as it is simulated: where the arm is told to stand, and what a person must know of it."""

    cell: Cell
    plan_id: str
    samples: Samples
    notes: tuple[str, ...]

    @classmethod
    def of_poses(cls, session: PlannedSession, drawn: bool) -> "_Drive":
        """Return the drive of a plan of poses; ``drawn``: whether the robot is drawn anew."""
        samples = planned_samples(session.cell, session.document, session.courses)
        notes = (*session.notes, *(simulated_run_warnings(session.document.notes) if drawn else ()))
        return cls(session.cell, session.plan_id, samples, notes)

    @classmethod
    def of_kind(cls, kind: PlanKind, plan: DrivenPlan, notes: tuple[str, ...]) -> "_Drive":
        """Return the drive of a plan of another kind than poses."""
        return cls(plan.cell, plan.plan_id, kind.load_maker().samples(plan, SAMPLE_RATE), notes)


def _drive_of_file(path: Path, drawn: bool) -> _Drive:
    if kind := _kind_of(path):
        read = _prove_anew(path, kind.load_maker().load(path))
        return _Drive.of_kind(kind, read, read.notes)
    return _Drive.of_poses(_read_drives(path), drawn)


def _drive_of(result: SessionResult | PosesResult, drawn: bool) -> _Drive:
    if isinstance(result, PosesResult):
        raise InputError(
            "the plan ended with its time limit before a path was proven, and has poses alone: plan it with a longer "
            "time limit to simulate its run"
        )
    if isinstance(result.plan, Plan):
        return _Drive.of_poses(PlannedSession.of(result.plan), drawn)
    return _Drive.of_kind(find_plan_kind(result.kind, Path(result.main_file)), result.plan, ())


def _kind_of(path: Path) -> PlanKind | None:
    """Return the kind of the plan at ``path``, nothing for one of poses."""
    content = read_json(path)
    name = content.get("kind") if isinstance(content, dict) else None
    return find_plan_kind(str(name), path) if name else None


def _read_drives(path: Path) -> PlannedSession:
    """Read what is driven; a path by hand has only its drives, and not all that a program is made of."""
    content = read_json(path)
    whole = isinstance(content, dict) and {"robot", "poses", "trajectory"} <= content.keys()
    session = load_session(path, "simulated", check=whole)
    return _prove_anew(path, session) if whole else session


def _proven_forms(path: Path) -> list[PathForm]:
    """Return the forms of the path that were proven when the plan at ``path`` was written: those of its programs."""
    known = dialect_names()
    return [driven_form(name) for name in read_dialects(path) if name in known]


def _program_of(path: Path, session: DrivenPlan, form: PathForm) -> Program:
    """Return the neutral program of the plan at ``path``.

    Raises:
        InputError: it asks for what no controller could drive.
    """
    try:
        return session_program(session.cell, session.courses, session.plan_id, form)
    except InputError as err:
        raise InputError(f"{path}: {err}") from err


S = TypeVar("S", bound=DrivenPlan)


def _prove_anew(path: Path, session: S) -> S:
    """Return a session whose path is proven: that of a plan as it was written is, any other's is proven anew."""
    if not session.notes:
        return session
    if not has_judges():  # nothing is driven: it is enough to say so
        return replace(session, notes=tuple(f"{note}; {NOT_PROVEN_ANEW}" for note in session.notes))
    program = _program_of(path, session, PathForm())
    return replace(session, notes=judge_plan(path, session.cell, program, session.notes, False))


@called_with(ImportCall)
def import_traces(asked: ImportCall) -> Run:
    """Return the run of controller and gauge traces: by a map, the log of a plan's own program, or images.

    Raises:
        InputError: none or several are named, or a file is wrong.
    """
    plan, dialect, traces = asked.plan, asked.dialect, [Path(trace) for trace in asked.traces]
    if asked.images is not None or asked.board is not None:
        return import_images(asked, traces)
    if asked.map_file is not None and not plan and not dialect:
        if not Path(asked.map_file).exists() and all(trace.is_file() for trace in traces):
            write_proposed_map(traces, Path(asked.map_file))
        return import_run(traces, Path(asked.map_file))
    if asked.map_file is None and plan is not None and dialect is not None:
        return import_log(traces, plan, dialect)
    raise InputError(
        "give either --map MAP.toml, or --plan PLAN.json and --dialect of the program that kept the log, or --images "
        "DIR and --board board.toml"
    )


def import_images(asked: ImportCall, tables: Sequence[Path]) -> Run:
    """Return the run of the images of a folder, with the joint angles of a table beside them.

    Raises:
        InputError: something is missing or does not go with images, or no image can be used.
        MissingProgramError: OpenCV is not installed.
    """
    beside = [f"--{n}" for n, v in (("map", asked.map_file), ("plan", asked.plan), ("dialect", asked.dialect)) if v]
    if asked.images is None or asked.board is None or beside or len(tables) != 1:
        raise InputError(
            "images are brought in by --images DIR and --board board.toml together, with one table of the joint angles "
            f"(pose, q1_deg …) before them{', without ' + ' and '.join(beside) if beside else ''}"
        )
    found = find_corners(Path(asked.images), BoardInImages.read(Path(asked.board)))
    run, missing = run_of_images(tables[0], found.poses, found.pixels)
    lacking = (f"{tables[0]}: has no pose {pose}; its image was left out" for pose in missing)
    return replace(run, warnings=(*run.warnings, *(f"{text}; left out" for text in found.left_out), *lacking))


def import_log(traces: Sequence[Path], plan: Path | str, dialect: str) -> Run:
    """Return the run of a plan from the log that its program kept, and from the gauge's trace.

    Args:
        traces: the log first.
        plan: the path of ``plan.json``.
        dialect: in which the program was written.

    Raises:
        InputError: no plan, an unknown dialect or one that keeps no log, a trace that is wrong, or the robot's file
            does not say how that controller counts its axes.
    """
    planned, name = read_plan(Path(plan), "poses"), f"the log of {dialect}"
    content = tomllib.loads(import_map(dialect, len(planned.poses[0].q_deg), planned.joint_units.count("mm"))) | {
        "plan_id": planned.plan_id
    }
    mapping = validate(content, ColumnMap, name)
    if len(traces) == 2 and not is_trace_of(traces[0], mapping) and is_trace_of(traces[1], mapping):
        raise InputError(f"{traces[0]} is not {name}, {traces[1]} is: give the log first, then the gauge's trace")
    return import_by_map(traces, mapping, name, _robot_of(Path(plan), planned.robot))


def _robot_of(plan: Path, name: str) -> Robot:
    """Return the robot of a plan: that of the cell beside it, else the shipped one of its name."""
    cell = plan.parent / "cell.toml"
    return load_cell(str(cell), planning=False).robot if cell.is_file() else load_robot(name)
