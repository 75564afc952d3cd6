"""``plan()``: the plan of a cell, whatever its gauge."""

from collections.abc import Sequence
from pathlib import Path

from planner.cell.cell import Cell
from planner.cell.reading import load_cell
from planner.common.choices import Aim, SelectionMethod, TourOrder
from planner.common.progress import Progress, Stages, TimeLimit, limit_time, no_progress
from planner.design.free_parameters import check_effects
from planner.motion.planning_packages import require_planning_packages
from planner.motion.tour.solve import Method
from planner.report.plan_report import report_plan
from planner.report.standby import drawing_process
from planner.session.bar_poses import BarPoses
from planner.session.options import PlanOptions, check_circle_options, check_point_options
from planner.session.plan_record import PathNotProvenError
from planner.session.plan_types import Plan
from planner.session.planning import PoseChooser, PoseSession, plan_session
from planner.session.point_poses import PointPoses
from planner.workflow.plan_results import CircularPlanResult, PlanResult, PosesResult


def plan(
    cell: Cell | Path | str,
    *,
    poses: int | None = None,
    index: str | None = None,
    seed: int = 0,
    dialect: Sequence[str] = (),
    tsp: Method = "auto",
    separate: Path | str | None = None,
    fixtures: int | None = None,
    aim: Aim | None = None,
    method: SelectionMethod | None = None,
    order: TourOrder | None = None,
    time_limit: float | None = None,
    progress: Progress = no_progress,
) -> PlanResult | PosesResult | CircularPlanResult:
    """Plan a measuring session: poses, certificate, collision-free path, robot programs.

    Args:
        cell: a cell, the path of its file, or ``robot/cell`` for a shipped one; with circles it is a circular test.
        poses: how many; by default where the index curve bends.
        index: observability index to select by, O1 to O5.
        seed: the same seed gives the same bytes.
        dialect: robot languages; by default those that the cell names.
        tsp: solver of the tour.
        separate: an ``identification.json``: choose poses that tell its findings from their rivals.
        fixtures: how many in all: good places are found for those beside the first.
        aim: poses by the index, or by the error that is left once hidden effects are traced.
        method: how the index selects: by exchange (``None``), or one pose at a time taken away, as in the EDBB paper;
            what exchange reaches is then told beside it.
        order: what the order of the poses is the shortest of; by default what the cell says.
        time_limit: seconds for planning; searches stop early, and the notes say what they left. The same seed then no
            longer gives the same bytes. Over before a path is proven: the poses alone, without a program.
        progress: called with the stage, how much of it is done, and of how much.

    Raises:
        InputError: the cell or an argument is wrong.
        NoSolutionError: a stage has no solution; the message says which.
        MissingProgramError: a package of planning is not installed.
    """
    require_planning_packages()
    file = None if separate is None else Path(separate)
    options = PlanOptions(poses, index, seed, tuple(dialect), tsp, file, fixtures, aim, method, order)
    stages, chosen = Stages(progress), cell if isinstance(cell, Cell) else load_cell(str(cell))
    limit = None if time_limit is None else TimeLimit(time_limit)
    with limit_time(limit):
        if not chosen.circles:
            try:
                return PlanResult(plan_cell(chosen, options, stages), stages, limit.notes if limit else ())
            except PathNotProvenError as cut:
                return PosesResult(cut.poses, (*(limit.notes if limit else ()), str(cut)))
        from planner.instruments.circular.planning import plan_circles  # needless for poses, and slow to load

        check_circle_options(chosen, options)
        return CircularPlanResult(plan_circles(chosen, options, stages), stages, limit.notes if limit else ())


def plan_cell(cell: Cell, options: PlanOptions, stages: Stages) -> Plan:
    """Plan a measuring session with a bar, at the balls of an artifact, or for a tracker.

    Raises:
        InputError: the cell or an option is wrong.
        NoSolutionError: a stage has no solution; the message says which.
    """
    check_effects(cell)
    return plan_session(pose_session(options.in_order(cell), options), options, stages, _begin_drawing)


def _begin_drawing(plan: Plan) -> None:
    """Let a process that stands by draw the pictures while the programs are written."""
    if drawing_process():
        report_plan(plan).draw_beside()


def pose_session(cell: Cell, options: PlanOptions, chooser: PoseChooser | None = None) -> PoseSession:
    """Return the session of poses of a bar, at the balls of an artifact, or for a tracker.

    Raises:
        InputError: an option is not for this gauge.
    """
    if cell.has_bar():
        return BarPoses(cell, options, chooser)
    check_point_options(cell, options)
    return PointPoses(cell, options, chooser)
