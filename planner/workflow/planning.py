"""``plan()``: the plan of a cell, whatever its gauge."""

from dataclasses import replace
from pathlib import Path

from planner.cell.cell import Cell
from planner.cell.fleet_file import with_fleet
from planner.cell.reading import load_cell
from planner.common.calls import called_with
from planner.common.files import folder_of
from planner.common.progress import UNLIMITED, Stages, TimeLimit
from planner.common.units import from_mm
from planner.design.free_parameters import check_effects
from planner.motion.planning_packages import require_planning_packages
from planner.next_session.planned_poses import NextSessionChooser
from planner.next_session.remaining_errors import (
    ROBOT,
    CalibratedState,
    leave_standing,
    places_in_region,
    places_of_program,
)
from planner.session.as_published import follow_paper
from planner.session.options import PlanOptions, check_point_options
from planner.session.plan_record import PathNotProvenError
from planner.session.plan_types import Plan
from planner.session.planning import PoseChooser, PoseSession, plan_session
from planner.session.point_poses import BarPoses, PointPoses
from planner.workflow.core_calls import PlanCall
from planner.workflow.plan_kinds import kind_of_cell
from planner.workflow.plan_results import PlanResult, PosesResult, SessionResult


@called_with(PlanCall)
def plan(asked: PlanCall) -> PlanResult | PosesResult | SessionResult:
    """Plan a measuring session: poses, certificate, collision-free path, robot programs.

    A cell with a section of an extension (circles, for instance) is planned by that extension. With a time limit the
    searches stop early, and the notes say what they left undone. The same seed then need not give the same bytes. If
    the time ends before a path is proven, only the poses are returned, without programs.

    Raises:
        InputError: the cell or an argument is wrong.
        NoSolutionError: a stage has no solution; the message says which.
        MissingProgramError: a package of planning is not installed.

    Example:
        >>> plan("comau-nj130/edbb", poses=60).write("session")  # doctest: +SKIP
    """
    require_planning_packages()
    limit = UNLIMITED if asked.time_limit_s is None else TimeLimit(asked.time_limit_s)
    stages = Stages(asked.progress, limit)
    chosen = asked.cell if isinstance(asked.cell, Cell) else load_cell(str(asked.cell))
    chosen = with_fleet(chosen, asked.fleet)
    if kind := kind_of_cell(chosen):
        made = kind.load_maker().plan(chosen, asked, stages)
        return replace(made, cut_short=limit.notes)
    try:
        return PlanResult(plan_cell(chosen, asked, stages), stages, limit.notes)
    except PathNotProvenError as cut:
        return PosesResult(cut.poses, (*limit.notes, str(cut)))


def plan_cell(cell: Cell, options: PlanOptions, stages: Stages) -> Plan:
    """Plan a measuring session with a bar, at the balls of an artifact, or for a tracker.

    Raises:
        InputError: the cell or an option is wrong.
        NoSolutionError: a stage has no solution; the message says which.
    """
    check_effects(cell)
    cell, options, notes = follow_paper(cell, options)
    chooser = _chooser(cell, options)
    if chooser is not None and options.same_mounting:
        cell = leave_standing(cell, chooser.before)
    session = pose_session(options.in_motion(cell), options, chooser)
    session.notes += notes
    return plan_session(session, options, stages)


def _chooser(cell: Cell, options: PlanOptions) -> NextSessionChooser | None:
    """Return the chooser of poses after other sessions; ``None`` for a robot of which nothing is known."""
    folder = options.folder_before
    if folder is None or not cell.has_bar():
        return None
    until = None if options.until_mm is None else float(from_mm(options.until_mm))
    before = CalibratedState.read(folder_of(folder), cell)
    counts = None
    if options.region is not None:
        counts = places_in_region(Path(options.region), cell)
    elif options.program is not None:
        counts = places_of_program(Path(options.program), before.folder / ROBOT)
    return NextSessionChooser(before, options.poses, until, counts)


def pose_session(cell: Cell, options: PlanOptions, chooser: PoseChooser | None = None) -> PoseSession:
    """Return the session of poses of a bar, at the balls of an artifact, or for a tracker.

    Raises:
        InputError: an option is not for this gauge.
    """
    if cell.has_bar():
        return BarPoses(cell, options, chooser)
    check_point_options(cell, options)
    return PointPoses(cell, options, chooser)
