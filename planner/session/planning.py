"""``plan_session()``: from a cell to a robot program, stage by stage, whatever is measured.

What is checked of a cell and of the languages of its programs before any planning.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from types import TracebackType
from typing import Protocol, Self, TypeVar

import numpy as np

from planner.cell.cell import Cell
from planner.common.choices import SelectionMethod
from planner.common.determinism import on_one_thread
from planner.common.errors import InputError, NoSolutionError
from planner.common.progress import Stages, TimeIsOverError, TimeLimit
from planner.common.second_process import ForkedTask
from planner.common.summary import Aside
from planner.common.units import Array
from planner.design.bayesian_design import BackgroundDesign
from planner.design.candidates.pool import PoseSet
from planner.design.discrimination.selection import DiscriminatingChoice
from planner.design.expected_errors import ErrorForecast, GoalOutOfReachError
from planner.design.fixtures.places import describe_other_place
from planner.design.free_parameters import undeclared_errors
from planner.design.observability.information import index_value
from planner.design.off_grid import certify_off_grid
from planner.design.pose_selection import PoseChoice, replace_pose
from planner.design.selection.certificate import Certificate
from planner.design.selection.index_search import BackgroundCurve
from planner.design.target_errors import foresee_targets
from planner.design.unnamed_errors import identified_errors
from planner.motion.collision.surroundings import check_surroundings
from planner.motion.tour.solve import require_concorde
from planner.programs.controller_axes import axis_convention
from planner.programs.dialect import load_dialect
from planner.programs.instructions import Centre, Instruction, JointMove
from planner.programs.verification import shared_notes
from planner.runs.run import FIRST_MOUNTING
from planner.session.neutral_program import (
    assemble_programs,
    build_program,
    jog_checks,
    preparation,
    session_program,
    write_programs,
    write_session,
)
from planner.session.notes import bar_notes, discrimination_notes, driven_discrimination, load_notes, session_notes
from planner.session.options import PlanOptions
from planner.session.plan_record import PathNotProvenError, UnprovenPoses, content_hash, plan_record
from planner.session.plan_types import Drive, Plan, SessionPlan
from planner.session.release import TourStop, candidate_stop
from planner.session.tour_cost import session_minutes
from planner.session.tour_drive import MountingSession, Unreachable, drive_tour

ANY_ROBOT = "poses-csv"
"""Written where neither the cell nor the robot names a language: a list that anybody can read."""


def settle_dialects(cell: Cell, options: PlanOptions) -> tuple[str, ...]:
    """Return the dialects to write; what is wrong with them, the cell or the solver is told before a minute's work.

    Raises:
        InputError: there is no such dialect, the robot's file does not say how its controller counts the axes, or
            the cell is wrong (see :func:`check_cell`).
        MissingProgramError: Concorde was asked for and is not there.
    """
    if options.tsp == "concorde":
        _ = require_concorde()
    dialects = tuple(options.dialect) or cell.controller.dialects or (cell.robot.dialect or ANY_ROBOT,)
    for name in dialects:
        _ = axis_convention(cell.robot, load_dialect(name))
    check_cell(cell, dialects)
    return dialects


def check_cell(cell: Cell, dialects: Sequence[str]) -> None:
    """Write a program of two moves in every dialect, and hold the surroundings against what the robot can reach.

    Raises:
        InputError: naming the key.
    """
    no_plan = "0" * 12  # stands for the plan of a program that no plan holds
    check_surroundings(cell)
    _check_home(cell)
    home = JointMove(tuple(float(v) for v in np.rad2deg(cell.home)), 10.0, 50.0, 5.0)
    body: list[Instruction] = [home]
    if cell.gauge.ball_to_centre(cell, cell.home) is not None:
        body.append(Centre(1, 1))
    body += preparation(cell, FIRST_MOUNTING)
    for name in dialects:
        try:
            write_session(cell, build_program(cell, no_plan, [*body, home]), name, cell.robot.name)
        except InputError as err:
            raise InputError(f"{cell.path}: the program in '{name}' cannot be written: {err}") from err


def _check_home(cell: Cell) -> None:
    robot = cell.robot
    off = np.flatnonzero((cell.home < robot.q_lower) | (cell.home > robot.q_upper))
    if len(off):
        key = "home_mm" if robot.slides[off[0]] else "home_deg"
        raise InputError(f"{cell.path}: {key} lies beyond the limit of joint {off[0] + 1}")


@dataclass(frozen=True)
class Selection:
    """The chosen poses, and what they were chosen for beside the index.

    Attributes:
        choice: the poses.
        curve: the index against their number, still being computed, where the index chose the poses.
        discriminating: where they tell the findings of an identification from their rivals.
        expected_error: what is left once hidden effects are traced, where that chose them; still being computed.
    """

    choice: PoseChoice
    curve: BackgroundCurve | None = None
    discriminating: DiscriminatingChoice | None = None
    expected_error: BackgroundDesign | None = None


class _Certifying:
    """The certificate of the poses as they are driven, found beside their drive; begun anew where one is replaced."""

    def __init__(self, certify: Callable[[PoseChoice], Certificate], choice: PoseChoice) -> None:
        self._certify = certify
        self._task = ForkedTask(partial(certify, choice))

    def begin(self, choice: PoseChoice) -> None:
        """Certify these poses in the place of those before."""
        self._task.stop()
        self._task = ForkedTask(partial(self._certify, choice))

    def result(self) -> Certificate:
        """Wait for the certificate of the last poses."""
        return self._task.result()

    def __enter__(self) -> Self:
        """Return what certifies."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it where the drive failed."""
        self._task.__exit__(kind, error, trace)


P = TypeVar("P", bound=SessionPlan)


class Session(Protocol[P]):
    """What is measured: poses of a bar, at balls or for a tracker, or what an extension plans."""

    cell: Cell

    def drive(self, stages: Stages) -> P:
        """Plan everything that is driven, up to the finished paths: a plan without id and programs."""

    def record(self, plan: P) -> dict[str, object]:
        """Return the keys of ``plan.json`` that fix what is driven and measured."""


@on_one_thread
def plan_session(session: Session[P], options: PlanOptions, stages: Stages) -> P:
    """Plan a measuring session: everything that is driven, its id, its programs.

    Raises:
        InputError: the cell or an option is wrong.
        NoSolutionError: a stage has no solution; the message says which.
    """
    dialects = settle_dialects(session.cell, options)
    bare = session.drive(stages)
    with stages.stage("programs"):
        bare = replace(bare, notes=(*bare.notes, *stages.limit.notes))
        return with_programs(replace(bare, plan_id=content_hash(session.record(bare), bare.cell)), dialects)


def with_programs(plan: P, dialects: tuple[str, ...]) -> P:
    """Return the plan with its program in each dialect, each read back and compared, and with what is to be known."""
    cell = plan.cell
    programs = assemble_programs(dialects, lambda form: session_program(cell, plan.courses, plan.plan_id, form))
    checks = (f"{name}: {text}" for name in programs for text in jog_checks(cell, name))
    return replace(plan, programs=write_programs(cell, programs), notes=(*plan.notes, *checks, *shared_notes(programs)))


class PoseChooser(Protocol):
    """Chooses poses from the pool of a session."""

    def __call__(self, session: "PoseSession", stages: Stages) -> Selection:
        """Return them."""


class PoseSession(ABC):
    """A session of poses; gauges differ in where poses come from, how they are chosen and how they are refined.

    ``cell`` and ``pool`` are settled by the first two stages; ``notes`` grow with each. A ``chooser`` chooses the poses
    for another purpose than a calibration.
    """

    pool: PoseSet

    def __init__(self, cell: Cell, options: PlanOptions, chooser: PoseChooser | None = None) -> None:
        self.cell, self.options, self.chooser = cell.with_reading_time(), options, chooser
        self.notes: list[str] = []
        self.index, self.poses = options.index or cell.plan.index, options.poses or cell.plan.poses
        self.method: SelectionMethod = options.method or cell.plan.method or "exchange"

    def drive(self, stages: Stages) -> Plan:
        """Draw, choose and refine the poses, and drive the tour of every mounting."""
        self.draw(stages)
        try:
            chosen = self.chooser(self, stages) if self.chooser else self.select(stages)
        except GoalOutOfReachError as err:
            with stages.stage("fixtures"):
                elsewhere = describe_other_place(self.cell, err, self.options.seed)
            raise NoSolutionError(f"{err}{elsewhere}") from None
        with chosen.curve or nullcontext(), chosen.expected_error or nullcontext():
            by_index = chosen.expected_error is None
            choice, certificate, drives = self._drive_refined_poses(self.refine(chosen, stages), by_index, stages)
        with stages.stage("index curve"):
            curve = chosen.curve.result() if chosen.curve else None
            expected = chosen.expected_error.result() if chosen.expected_error else None
        cell, discriminating = self.cell, chosen.discriminating
        driven = driven_discrimination(cell, discriminating, drives) if discriminating else None
        bar = bar_notes(cell, drives) if cell.has_bar() else ()
        notes = [*self.notes, *bar, *discrimination_notes(cell, driven, choice, drives)]
        forecast: ErrorForecast | None = None
        minutes = session_minutes(cell, drives, len(choice.q))
        if expected:
            notes.append(Aside(f"the poses were chosen by the expected error, not by {choice.index}"))
            left = identified_errors(expected.unknown, cell, choice.samples)
            forecast = expected.with_driven_poses(choice.samples, minutes, left)
        elif any(v.role == "calibrate" for d in drives for v in d.visits) and not self.chooser:
            unknown = undeclared_errors(cell, choice.samples)
            forecast = ErrorForecast.of(identified_errors(unknown, cell, choice.samples), choice.samples, minutes)
        return Plan(
            cell=cell,
            seed=self.options.seed,
            drives=drives,
            notes=(*notes, *session_notes(cell), *load_notes(cell, choice.samples)),
            pool=self.pool,
            choice=choice,
            certificate=certificate,
            curve=curve,
            driven=index_value(choice.index, self.driven_rows(choice, drives)),
            separation=driven,
            forecast=forecast,
            targets=None if forecast is None else foresee_targets(cell, forecast.unknown, choice.samples),
        )

    def _drive_refined_poses(
        self, refined: PoseChoice, by_index: bool, stages: Stages
    ) -> tuple[PoseChoice, Certificate, tuple[Drive, ...]]:
        """Drive all places, and certify the poses beside that; those that are driven come with the drives."""

        def certify(choice: PoseChoice) -> Certificate:
            """Return the bound for poses as they are driven."""
            return certify_off_grid(self.cell, self.pool, choice, stages.limit) if by_index else choice.certificate

        try:
            certifying = _Certifying(certify, refined)
            with certifying, stages.stage("path"):
                drives, choice = self._drive_places(refined, stages.limit, certifying.begin)
        except TimeIsOverError as over:
            certificate = certify(refined)
            notes = (*self.notes, *session_notes(self.cell), *stages.limit.notes)
            raise PathNotProvenError(
                UnprovenPoses(self.cell, self.options.seed, self.pool, refined, certificate, notes, str(over))
            ) from over
        return choice, certifying.result(), drives

    def _drive_places(
        self, choice: PoseChoice, limit: TimeLimit, replaced: Callable[[PoseChoice], object] = lambda _: None
    ) -> tuple[tuple[Drive, ...], PoseChoice]:
        """Drive the tour of every mounting; a pose that no path joins is ``replaced``, and a note says so."""
        most_rounds = 20  # of replacing poses that no path joins, before the cell is taken to be split
        checks, gone = self.draw_validation(choice), np.zeros(0, dtype=int)
        drives: list[Drive] = []
        for place in self.places(limit):
            for _ in range(most_rounds):
                mine = np.flatnonzero(choice.samples.at_mounting(place.mounting))
                others = checks[self.pool.samples.take(checks).at_mounting(place.mounting)]
                laps = self.options.laps or 1
                stops = [replace(self.stop(choice, int(k)), lap=n * laps // len(mine)) for n, k in enumerate(mine)]
                stops += [candidate_stop(self.pool, int(k), "validate") for k in others]
                first = sum(len(d.visits) for d in drives)
                try:
                    drives.append(drive_tour(place, stops, self.options.tsp, self.options.seed, first))
                    break
                except Unreachable as lost:
                    at = np.array(lost.which)
                    chosen = mine[at[at < len(mine)]]
                    checks = np.setdiff1d(checks, others[at[at >= len(mine)] - len(mine)])
                    gone = np.union1d(gone, choice.chosen[chosen])
                    for k in chosen.tolist():
                        choice = self.replace(choice, k, gone)
                    if len(chosen):
                        replaced(choice)
                    name = place.cell.place_name(place.mounting)
                    where = f" (fixture {name})" if name else ""
                    what = "a pose" if len(at) == 1 else f"{len(at)} poses"
                    was = "was" if len(at) == 1 else "were"
                    self.notes.append(Aside(f"{what} that no path could join {was} replaced{where}"))
            else:
                raise NoSolutionError(
                    f"{most_rounds} times poses could not be joined to the tour: obstacles split the cell; move the "
                    "fixture or what is in the way, lower motion.clearance_mm, or try another --seed"
                )
        self.notes += [note for d in drives for note in d.tour.notes]
        return tuple(drives), choice

    def record(self, plan: Plan) -> dict[str, object]:
        """Return the part of the plan that fixes what is driven and measured, of which its id is the hash."""
        return plan_record(plan)

    @abstractmethod
    def draw(self, stages: Stages) -> None:
        """Settle the mount poses and draw the candidates, those that a path joins to them."""

    @abstractmethod
    def select(self, stages: Stages) -> Selection:
        """Choose the poses to be measured."""

    @abstractmethod
    def refine(self, chosen: Selection, stages: Stages) -> PoseChoice:
        """Replace and move chosen poses so that all can be reached."""

    @abstractmethod
    def draw_validation(self, choice: PoseChoice) -> np.ndarray:
        """Return the validation poses: candidates that judge the fit and take no part in it."""

    @abstractmethod
    def places(self, limit: TimeLimit) -> list[MountingSession]:
        """Return the poses that are measured with each mounting of the gauge."""

    @abstractmethod
    def stop(self, choice: PoseChoice, k: int) -> TourStop:
        """Return the chosen pose ``k`` as a stop of the tour."""

    def replace(self, choice: PoseChoice, lost: int, gone: np.ndarray) -> PoseChoice:
        """Replace a chosen pose that no path joins, by none of the candidates that are ``gone``."""
        return replace_pose(self.pool, choice, lost, gone)

    @abstractmethod
    def driven_rows(self, choice: PoseChoice, drives: tuple[Drive, ...]) -> Array:
        """Return the Jacobian's rows as they are driven."""
