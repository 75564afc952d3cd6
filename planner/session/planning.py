"""``plan_session()``: from a cell to a robot program, stage by stage, for every gauge that measures poses."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from planner.cell.cell import Cell
from planner.common.determinism import on_one_thread
from planner.common.errors import NoSolutionError
from planner.common.progress import Stages
from planner.common.units import Array
from planner.design.bayesian_design import BayesianDesign
from planner.design.candidates.pool import PoseSet
from planner.design.discrimination.selection import DiscriminatingChoice
from planner.design.observability.information import index_value
from planner.design.pose_selection import PoseChoice
from planner.design.selection.index_curves import BackgroundCurve
from planner.programs.program_files import shared_notes
from planner.session.approaches import TourStop
from planner.session.neutral_program import assemble_programs, session_program, write_programs
from planner.session.notes import discrimination_as_driven, discrimination_notes, session_notes
from planner.session.options import PlanOptions
from planner.session.plan_record import plan_hash
from planner.session.plan_types import Drive, Plan
from planner.session.tour_drive import FixtureSession, Unreachable, drive_tour

REPLACEMENTS = 20


@dataclass(frozen=True)
class Selection:
    """The chosen poses, and what they were chosen for beside the index.

    Attributes:
        choice: the poses.
        curve: the index against their number, still being computed.
        discriminating: where they tell the findings of an identification from their rivals.
        foreseen: where they were chosen by the error that is left once hidden effects are traced.
    """

    choice: PoseChoice
    curve: BackgroundCurve
    discriminating: DiscriminatingChoice | None = None
    foreseen: BayesianDesign | None = None


class PoseSource(Protocol):
    """What differs between gauges: where poses come from, how they are chosen, and what is kept on the way to them.

    ``cell`` and ``pool`` are settled by the first two stages; ``notes`` grow with each.
    """

    cell: Cell
    pool: PoseSet
    notes: list[str]

    def draw(self, stages: Stages) -> None:
        """Settle the mount poses and draw the candidates, those that a path joins to them."""

    def select(self, stages: Stages) -> Selection:
        """Choose the poses to be measured."""

    def refine(self, chosen: Selection, stages: Stages) -> PoseChoice:
        """Replace and move chosen poses so that all can be reached."""

    def draw_validation(self, choice: PoseChoice) -> np.ndarray:
        """Return the candidates by which the fit is judged that never sees them."""

    def places(self) -> list[FixtureSession]:
        """Return what is measured from each fixture."""

    def stop(self, choice: PoseChoice, k: int) -> TourStop:
        """Return the chosen pose ``k`` as a stop of the tour."""

    def validation_stop(self, candidate: int) -> TourStop:
        """Return a candidate as a stop that validates."""

    def replace(self, choice: PoseChoice, lost: int) -> PoseChoice:
        """Replace a chosen pose that no path joins."""

    def driven_rows(self, choice: PoseChoice, drives: tuple[Drive, ...]) -> Array:
        """Return the Jacobian's rows as they are driven."""

    def drive_notes(self, drives: tuple[Drive, ...]) -> tuple[str, ...]:
        """Return what a person must know of the finished drives."""


@on_one_thread
def plan_session(source: PoseSource, options: PlanOptions, stages: Stages) -> Plan:
    """Plan a measuring session with the poses of ``source``.

    Raises:
        InputError: the cell or an option is wrong.
        NoSolutionError: a stage has no solution; the message says which.
    """
    dialects = options.known_dialects(source.cell)
    source.draw(stages)
    cell = source.cell
    chosen = source.select(stages)
    with chosen.curve:
        choice = source.refine(chosen, stages)
        with stages.stage("path"):
            drives, choice = _drive_places(source, choice, options)
    with stages.stage("index curve"):
        curve = chosen.curve.result()
    with stages.stage("programs"):
        told = discrimination_as_driven(cell, chosen.discriminating, drives) if chosen.discriminating else None
        notes = (*source.notes, *source.drive_notes(drives), *discrimination_notes(cell, told, choice, drives))
        ahead = chosen.foreseen
        if ahead:
            notes += (f"the poses are chosen by the error that is foreseen; {choice.index} does not judge them",)
            ahead = replace(ahead, left=ahead.with_poses(choice.q, choice.fixture))
        driven = index_value(choice.index, source.driven_rows(choice, drives))
        bare = Plan("0" * 12, cell, options.seed, source.pool, choice, curve, drives, driven, (), notes, told, ahead)
        return with_programs(replace(bare, plan_id=plan_hash(bare)), dialects)


def with_programs(plan: Plan, dialects: tuple[str, ...]) -> Plan:
    """Return the plan with its program in each dialect, each read back and compared, and with what is to be known."""
    cell, courses = plan.cell, tuple(d.course for d in plan.drives)
    programs = assemble_programs(dialects, lambda dense: session_program(cell, courses, plan.plan_id, dense))
    notes = (*plan.notes, *session_notes(cell), *shared_notes(programs))
    return replace(plan, programs=write_programs(cell, programs), notes=notes)


def _drive_places(source: PoseSource, choice: PoseChoice, options: PlanOptions) -> tuple[tuple[Drive, ...], PoseChoice]:
    """Drive the tour of every fixture; a pose that no path joins is replaced after all, and told."""
    checks = source.draw_validation(choice)
    drives: list[Drive] = []
    for place in source.places():
        for _ in range(REPLACEMENTS):
            mine = np.flatnonzero(choice.fixture == place.fixture)
            others = checks[source.pool.fixture[checks] == place.fixture]
            stops = [source.stop(choice, int(k)) for k in mine]
            stops += [source.validation_stop(int(k)) for k in others]
            first = sum(len(d.visits) for d in drives)
            try:
                drives.append(drive_tour(place, stops, options.tsp, options.seed, first))
                break
            except Unreachable as lost:
                if lost.which < len(mine):
                    choice = source.replace(choice, int(mine[lost.which]))
                else:
                    checks = np.setdiff1d(checks, others[lost.which - len(mine)])
                name = place.cell.place_name(place.fixture)
                where = f" (fixture {name})" if name else ""
                source.notes.append(f"a pose that no path could join was replaced{where}")
        else:
            raise NoSolutionError(
                f"{REPLACEMENTS} poses in a row could not be joined to the tour: obstacles split the cell"
            )
    source.notes += [note for d in drives for note in d.tour.notes]
    return tuple(drives), choice
