"""``plan()``: from a cell to a robot program, in the order of the picture in the README."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.cell.file import Aim
from planner.common.determinism import on_one_thread
from planner.common.errors import InputError, NoSolutionError
from planner.common.units import Array
from planner.design.bayesian_design import BayesianDesign, select_bayesian_poses
from planner.design.candidates.pool import PoseSet, draw_candidates
from planner.design.discrimination.findings import IdentificationResult, read_identification
from planner.design.discrimination.selection import DiscriminatingChoice, select_discriminating_poses
from planner.design.observability.information import index_value
from planner.design.pose_selection import (
    PoseChoice,
    judge_given_poses,
    refine_poses,
    select_poses,
    traceable_pose_count,
)
from planner.design.selection.index_curves import BackgroundCurve
from planner.motion.tour.solve import Method, require_concorde
from planner.programs.program_files import dialect_info, write_program
from planner.programs.rendering import ProgramFile
from planner.session.bar_drive import TourStop, Unreachable, drive_bar
from planner.session.course import is_continuous
from planner.session.mount import drop_unreachable, with_mounts
from planner.session.neutral_program import session_program
from planner.session.notes import bar_notes, discrimination_as_driven, discrimination_notes, session_notes
from planner.session.plan_file import plan_hash
from planner.session.plan_types import Drive, Plan
from planner.session.replacement import replace_pose, replace_unjoined

REPLACEMENTS = 20
DRIVEN_SAMPLES = 2000
Progress = Callable[[str, int, int], None]


@dataclass
class Stages:
    """Says what is going on and keeps the seconds of each stage."""

    say: Progress
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[Callable[[int, int], None]]:
        """Time one stage; yields a callback for its progress (done, of)."""
        start = time.perf_counter()
        self.say(name, 0, 0)
        yield lambda done, of: self.say(name, done, of)
        self.seconds[name] = round(self.seconds.get(name, 0.0) + time.perf_counter() - start, 3)


@dataclass(frozen=True)
class PlanOptions:
    """What the command line may change; ``None`` leaves it to the cell."""

    poses: int | None = None
    index: str | None = None
    seed: int = 0
    dialects: tuple[str, ...] = ()
    tsp: Method = "auto"
    separate: Path | None = None
    fixtures: int | None = None
    aim: Aim | None = None

    def for_tracing(self, cell: Cell) -> bool:
        """Tell whether the poses are to show what nobody has declared.

        Raises:
            InputError: they are to tell rivals apart as well.
        """
        wanted = (self.aim or cell.plan.aim) == "tracing"
        if wanted and self.separate:
            raise InputError(f"{cell.path}: --separate chooses the poses, and so does the aim 'tracing': leave one out")
        return wanted

    def known_dialects(self, cell: Cell) -> tuple[str, ...]:
        """The dialects to write; an unknown one, or a solver that is not there, is told before a minute's work.

        Raises:
            InputError: there is no such dialect.
            MissingProgramError: Concorde was asked for and is not there.
        """
        if self.tsp == "concorde":
            _ = require_concorde()
        dialects = self.dialects or cell.controller.dialects
        for name in dialects:
            _ = dialect_info(name)
        return dialects


@on_one_thread
def plan_bar(cell: Cell, options: PlanOptions, stages: Stages) -> Plan:
    """Plan a measuring session.

    Raises:
        InputError: the cell or an option is wrong.
        NoSolutionError: a stage has no solution; the message says which.
    """
    dialects = options.known_dialects(cell)
    _ = options.for_tracing(cell)
    robot = cell.robot
    rivals = read_identification(options.separate, robot.name, robot.n_joints) if options.separate else None
    with stages.stage("candidates") as progress:
        cell = with_mounts(cell, options.seed)
        pool = draw_candidates(cell, cell.plan.candidates, options.seed, progress)
    index, poses = options.index or cell.plan.index, options.poses or cell.plan.poses
    with stages.stage("roadmap"):
        pool, apart = drop_unreachable(cell, pool, index, poses, options.seed)
    chosen = _select(cell, pool, poses, index, options, rivals, stages)
    choice, curve, parted, ahead = chosen.choice, chosen.curve, chosen.parted, chosen.ahead
    with curve, stages.stage("refinement"):
        choice, swapped = replace_unjoined(cell, pool, choice, options.seed)
        choice = choice if parted or ahead else refine_poses(cell, choice, options.seed)
    with curve, stages.stage("path"):
        drives, choice, notes = _drive_fixtures(cell, pool, choice, options)
    with stages.stage("index curve"):
        points = curve.result()
    with stages.stage("programs"):
        driven = index_value(choice.index, _jacobian_as_driven(cell, choice, drives))
        told = discrimination_as_driven(cell, parted, drives) if parted else None
        notes = apart + swapped + notes + bar_notes(cell, drives) + discrimination_notes(cell, told, choice, drives)
        notes += (f"the poses are chosen by the error that is foreseen; {index} does not judge them",) if ahead else ()
        ahead = replace(ahead, left=ahead.with_poses(choice.q, choice.fixture)) if ahead else None
        bare = Plan("0" * 12, cell, options.seed, pool, choice, points, drives, driven, (), notes, told, ahead)
        named = replace(bare, plan_id=plan_hash(bare))
        more = session_notes(cell, (d.course for d in drives), named.plan_id, dialects)
        return replace(
            named, programs=tuple((name, program_files(named, name)) for name in dialects), notes=(*named.notes, *more)
        )


@dataclass(frozen=True)
class _Selection:
    """The poses, the index curve that is still being computed, and what they were chosen for beside the index."""

    choice: PoseChoice
    curve: BackgroundCurve
    parted: DiscriminatingChoice | None = None
    ahead: BayesianDesign | None = None


def _select(
    cell: Cell,
    pool: PoseSet,
    poses: int | None,
    index: str,
    options: PlanOptions,
    rivals: IdentificationResult | None,
    stages: Stages,
) -> _Selection:
    """Choose the poses by the index, for telling rivals apart, or for what nobody has declared."""
    if options.for_tracing(cell):
        with stages.stage("foresight") as progress:
            ahead = select_bayesian_poses(cell, pool, poses, progress)
        with stages.stage("selection"):
            return _Selection(*judge_given_poses(cell, pool, ahead.chosen, index, options.seed), ahead=ahead)
    with stages.stage("selection"):
        poses = traceable_pose_count(cell, pool) if rivals and poses is None else poses
        choice, curve = select_poses(cell, pool, poses, index, options.seed)
    if not rivals:
        return _Selection(choice, curve)
    with curve, stages.stage("separation"):
        parted = select_discriminating_poses(cell, pool, choice, rivals, options.seed)
    return _Selection(parted.choice, curve, parted)


def program_files(plan: Plan, dialect: str) -> tuple[ProgramFile, ...]:
    """Write the session of a plan in one dialect; it is read back and compared before it is returned."""
    program = session_program(
        plan.cell, (d.course for d in plan.drives), plan.plan_id, dialect_info(dialect).wants_dense_path
    )
    return write_program(program, dialect, f"{plan.cell.robot.name}_{plan.cell.name.rpartition('/')[2]}")


def _drive_fixtures(
    cell: Cell, pool: PoseSet, choice: PoseChoice, options: PlanOptions
) -> tuple[tuple[Drive, ...], PoseChoice, tuple[str, ...]]:
    """Drive the tour of every fixture; a pose that no path joins is replaced after all, and told."""
    checks = _draw_validation_poses(cell, pool, choice, options.seed)
    bare = f"{cell.robot.name} has no collision bodies: only the bar and the tool were checked against the surroundings"
    notes = [] if cell.robot.bodies else [bare]
    repeats = cell.plan.repeat if cell.motion.measure == "static" else 0
    drives: list[Drive] = []
    for fixture in range(len(cell.fixtures)):
        for _ in range(REPLACEMENTS):
            mine = np.flatnonzero(choice.fixture == fixture)
            sides = choice.approach
            stops = [TourStop(choice.q[k], "calibrate", None if sides is None else sides[k]) for k in mine]
            stops += [TourStop(pool.q[k], "validate") for k in checks if pool.fixture[k] == fixture]
            try:
                first = sum(len(d.visits) for d in drives)
                drives.append(drive_bar(cell, fixture, stops, repeats, pool, options.tsp, options.seed, first))
                break
            except Unreachable as lost:
                if lost.which < len(mine):
                    choice = replace_pose(pool, choice, int(mine[lost.which]))
                else:
                    checks = np.delete(checks, lost.which - len(mine))
                notes.append(f"a pose that no path could join was replaced (fixture {cell.place_name(fixture)})")
        else:
            raise NoSolutionError(
                f"{REPLACEMENTS} poses in a row could not be joined to the tour: the shell is split by obstacles"
            )
    notes += [note for d in drives for note in d.tour.notes]
    return tuple(drives), choice, tuple(notes)


def _draw_validation_poses(cell: Cell, pool: PoseSet, choice: PoseChoice, seed: int) -> np.ndarray:
    """Poses for checking the fit that it never sees: drawn blindly from the pool, none of them chosen."""
    others = np.setdiff1d(np.arange(len(pool)), choice.chosen)
    count = min(cell.plan.validate, len(others))
    return np.sort(np.random.default_rng(seed).choice(others, count, replace=False))


def _jacobian_as_driven(cell: Cell, choice: PoseChoice, drives: tuple[Drive, ...]) -> Array:
    """Rows of the trajectory as it is driven: at the poses' closest passage when continuous, else at rest."""
    rows = []
    for d in drives:
        t = np.linspace(0.0, d.trajectory.duration_s, DRIVEN_SAMPLES)
        q = d.trajectory.at(t).q if is_continuous(cell) else np.array([v.q for v in d.visits if v.role == "calibrate"])
        rows.append(choice.model.jacobian(q, d.fixture))
    return np.vstack(rows)
