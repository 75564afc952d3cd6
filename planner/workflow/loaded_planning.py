"""``plan_both()`` and ``study_places()``: circles under load beside poses without, and where they tell most.

The plan of a circular test: how it is made, read again, and given to a person.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from planner.cell.cell import Cell
from planner.cell.reading import cell_file_of, load_cell
from planner.circular.document import CircularDocument, circular_document, load_circular_plan
from planner.circular.plan import CircularPlan, circle_samples
from planner.common.calls import called_with
from planner.common.console import as_word
from planner.common.content_hashes import HandEdit
from planner.common.errors import InputError, NoSolutionError
from planner.common.files import write_text
from planner.common.numbers import number_of
from planner.common.progress import Stages
from planner.common.result import FolderResult
from planner.common.summary import Fact, Summary, under_key
from planner.common.units import to_deg, to_mm
from planner.loaded.circle_candidates import CirclePlaceChoice, find_circle_places, study_circle_places, with_circles
from planner.loaded.common_fit import (
    CommonFit,
    UnloadedPoses,
    check_both_cells,
    collision_free_places,
    driven_places,
    plan_circles_beside,
    predict_common_fit,
)
from planner.loaded.results import (
    common_fit_content,
    describe_common_fit,
    describe_places,
    places_content,
    places_csv,
    share_text,
)
from planner.motion.collision.body_gaps import clearance_text
from planner.motion.planning_packages import require_planning_packages
from planner.runs.run import Samples
from planner.session.evaluations import evaluation_of
from planner.session.options import PlanOptions
from planner.session.plan_types import Plan
from planner.workflow.circle_calls import LoadedPlacesCall, PlanBothCall
from planner.workflow.plan_results import PlanResult, SessionResult, write_cell
from planner.workflow.planning import plan_cell

if TYPE_CHECKING:
    from planner.report.page import Report


@dataclass(frozen=True)
class CircularPlanResult(SessionResult):
    """A planned circular test.

    Attributes:
        plan: circles, drives and programs.

    Example:
        >>> plan("comau-nj130/circular").write("circles")  # doctest: +SKIP
    """

    kind = "circular"
    one_clock = True
    plan: CircularPlan

    def document(self) -> CircularDocument:
        """Return what ``plan.json`` holds."""
        return circular_document(self.plan)

    def report(self) -> Report:
        """Return the page of the plan and its pictures."""
        from planner.report.circular_report import report_circular_plan  # plotting: others start quicker without

        return report_circular_plan(self.plan)

    def overview(self) -> Summary:
        """Return the overview of the drive."""
        return circular_overview(self.plan)

    def next_step(self, folder: Path) -> str:
        """Say how the circles are measured and evaluated."""
        plan = folder / "plan.json"
        measure = self.plan.cell.gauge.measuring_command.replace("PLAN", as_word(plan))
        return f"{measure}\n{evaluation_of('run.csv', plan, self.kind, calibrates=False)}"


def circular_overview(plan: CircularPlan) -> Summary:
    """Return the overview of a circular test."""
    arcs = plan.arcs
    minutes = sum(c.duration for c in plan.courses) / 60
    facts: list[Fact] = []
    for a in arcs:
        c = a.circle
        loads = f", {number_of(len(c.loads), 'load')}" if c.loads else ""
        bar = f"bar {to_mm(a.length.min()):.1f} to {to_mm(a.length.max()):.1f} mm"
        sweep = f"{to_deg(c.sweep):g}° from {to_deg(c.start):g}°, {' and '.join(c.directions)}{loads}"
        facts.append((c.name, f"{c.plane}, radius {to_mm(c.radius):g} mm, {sweep}, {to_mm(c.speed):.4g} mm/s; {bar}"))
        facts.append(("", a.told))
    clearance = min(v.clearance for v in plan.verdicts)
    facts.append(("drive", f"{minutes:.0f} min; {clearance_text(plan.cell, clearance)}"))
    count = number_of(len(arcs), "circle")
    return Summary(f"{plan.cell.name}: circular test on {count}, plan {plan.plan_id}", facts, notes=plan.notes)


class CircularMaker:
    """Plans the circles of a cell, and reads their plans."""

    def plan(self, cell: Cell, options: PlanOptions, stages: Stages) -> CircularPlanResult:
        """Plan the circular test of a cell, as :func:`.plan_circles` does."""
        from planner.circular.planning import plan_circles  # needless to read a plan, and slow to load

        _check_options(cell, options)
        return CircularPlanResult(plan_circles(cell, options, stages), stages)

    def load(self, path: Path) -> CircularPlan:
        """Read the plan at a path with the cell beside it."""
        return load_circular_plan(path)

    def samples(self, plan: CircularPlan, rate: float) -> Samples:
        """Return where the arm is told to stand while the passes are driven, ``rate`` times a second."""
        return circle_samples(plan, rate)


def _check_options(cell: Cell, options: PlanOptions) -> None:
    """Check that nothing is asked of a circular test that only a choice of poses can give.

    Raises:
        InputError: with the options to leave out.
    """
    of_choice = [f.name for f in fields(PlanOptions) if f.default is None]
    given = ", ".join(f"--{name.replace('_', '-')}" for name in of_choice if getattr(options, name) is not None)
    if given:
        raise InputError(f"{cell.path}: a circular test has no poses to be chosen; leave out {given}")


UNLOADED, LOADED = "unloaded", "loaded"  # folders of the two plans
BOTH_FILES = (
    (f"{UNLOADED}/report.html", "the plan without load, where it was not there already"),
    (f"{LOADED}/report.html", "the plan of the loaded circles"),
    ("cell.toml", "the cell of the fit of both runs"),
    ("both.json", "these figures for a program"),
)


@dataclass(frozen=True)
class BothPlan(FolderResult):
    """A session with both bars.

    Attributes:
        unloaded: the plan without load; ``None`` where it was there already, at ``source``.
        free: its poses and cell.
        loaded: the circles at the chosen places.
        known: what each kind of run alone, and one fit of both, would know.
    """

    main_file = "both.json"
    source: Path | None
    unloaded: Plan | None
    free: UnloadedPoses
    loaded: CircularPlan
    known: CommonFit
    stages: Stages = field(default_factory=Stages)

    @property
    def hand_edits(self) -> tuple[HandEdit, ...]:
        """Return what a person changed in the robot's files."""
        return self.free.cell.robot.hand_edits

    def overview(self) -> Summary:
        """Return the overview: what is measured, and how well each bar and both together know the compliances."""
        arcs, robot = self.loaded.arcs, self.loaded.cell.robot.name
        minutes = sum(c.duration for c in self.loaded.courses) / 60
        facts = [("drive", f"{minutes:.1f} min with the loaded bar on, proven as every plan is")]
        facts += [("found", s) for s in describe_common_fit(self.known)]
        poses, circles = number_of(len(self.free.samples), "pose"), number_of(len(arcs), "loaded circle")
        title = f"{robot}: {poses} without load, {circles}"
        return Summary(title, facts, [*self._places(), *self._predictions()], self.loaded.notes)

    def _page_text(self) -> str:
        """Return the content of the page: places, the four steps, and the predictions as a picture."""
        said = self.overview()
        steps = [(f"{k + 1}.", text) for k, text in enumerate(both_session_steps(self))]
        return Summary(said.title, [*self._places(), *said.facts, *steps], notes=said.notes).text()

    def _places(self) -> list[Fact]:
        facts: list[Fact] = []
        for arc in self.loaded.arcs:
            circle = arc.circle
            centre = ", ".join(f"{v:.0f}" for v in to_mm(circle.p_BC))
            facts.append((circle.name, f"{circle.plane} about [{centre}] mm; {arc.told}"))
        return facts

    def _predictions(self) -> list[Fact]:
        head = f"{'':<14}{'without load':>14}{'circles':>12}{'one fit':>12}   of the prior sigma"
        shares = [(name, *(share_text(float(v)) for v in parts)) for name, *parts in self.known.of("compliance")]
        rows = (f"{name:<14}{one:>14}{two:>12}{both:>12}" for name, one, two, both in shares)
        return under_key("predicted", [head, *rows])

    def content(self) -> Mapping[str, Any]:
        """Return what ``both.json`` says."""
        poses, circles = len(self.free.samples), [a.circle.name for a in self.loaded.arcs]
        return common_fit_content(self.known, self.loaded.cell.robot.name, poses, circles, both_session_steps(self))

    def fill(self, draft: Path) -> None:
        """Write ``unloaded/`` and ``loaded/``, each a whole plan, and ``cell.toml`` of the fit."""
        # plotting: other commands start quicker without
        from planner.report.loaded_report import draw_common_fit
        from planner.report.page import report_overview

        if self.unloaded is not None:
            PlanResult(self.unloaded, self.stages).write(draft / UNLOADED)
        CircularPlanResult(self.loaded, self.stages).write(draft / LOADED)
        with self.stages.stage("report"):
            write_cell(fit_cell(self.free.cell, self.loaded.cell), draft)
            cell, charts = self.loaded.cell, (draw_common_fit(self.known),)
            title = f"A session with both bars for {cell.robot.title}"
            report_overview(title, cell, self._page_text(), charts, BOTH_FILES).write(draft)

    def files(self, folder: Path) -> str:
        """Name what is written."""
        new = f"{UNLOADED}/, " if self.unloaded is not None else ""
        return f"{new}{LOADED}/, cell.toml, both.json, report.html"

    def next_step(self, folder: Path) -> str:
        """Say the four steps, with the files of the folder."""
        own = f"--cell {as_word(folder / 'cell.toml')}"
        steps = (text.replace("--cell cell.toml", own) for text in both_session_steps(self))
        return "\n".join(f"{k}. {text}" for k, text in enumerate(steps, 1))


@called_with(PlanBothCall)
def plan_both(asked: PlanBothCall) -> BothPlan:
    """Plan a session with an unloaded and a loaded bar; radius, loads and repeats are those of the loaded circle.

    Raises:
        InputError: the cells do not belong together, or ask for what cannot be.
        NoSolutionError: a stage has no solution; the message says which.
    """
    require_planning_packages()
    unloaded, places, stages = asked.unloaded, asked.places, Stages(asked.progress)
    options = PlanOptions(poses=asked.poses, seed=asked.seed, dialect=asked.dialect)
    cell = load_cell(asked.loaded)
    source = Path(unloaded) if unloaded.endswith(".json") else None
    there = UnloadedPoses.read(source) if source else None
    free_cell = there.cell if there else load_cell(unloaded)
    check_both_cells(free_cell, cell)
    with stages.stage("places"):
        pool = collision_free_places(cell, find_circle_places(cell, options.seed))
    if places > len(pool):
        raise NoSolutionError(
            f"{cell.path}: {places} places were asked for, but only {len(pool)} circles can be driven without collision"
        )
    made = None if there else plan_cell(free_cell, options, stages)
    free = there if made is None else UnloadedPoses.of(made)
    assert free is not None
    driven = plan_circles_beside(cell, free, pool, places, options, stages)
    known = predict_common_fit(free, cell, driven_places(driven))
    return BothPlan(source, made, free, driven, known, stages)


def both_session_steps(done: BothPlan) -> tuple[str, ...]:
    """Say in which order everything is done, and with which files."""
    first = f"{done.source.parent.name}/{done.source.name}" if done.source is not None else UNLOADED
    return (
        f"the bar without load: run the program of {first}, its log is the run FREE.csv",
        f"the loaded bar: run the program of {LOADED}, which tells where it stands and when the load changes; its log "
        "with force_N is the run LOADED.csv",
        "both in one fit: edbb loaded LOADED.csv --unloaded FREE.csv --cell cell.toml -o DIR",
        "the corrected robot: edbb identify DIR/joint.csv --cell cell.toml -o CALIBRATED",
    )


def fit_cell(free: Cell, loaded: Cell) -> Cell:
    """Return the cell of the common fit: the loaded circles, all fixtures, a gauge that reaches as far as both bars."""
    content = loaded.file.model_dump(mode="json", by_alias=True, exclude_none=True)
    other = free.file.model_dump(mode="json", by_alias=True, exclude_none=True)
    content["fixtures"] += [{k: v for k, v in f.items() if k != "mount_deg"} for f in other["fixtures"]]
    gauges = content["gauge"], other["gauge"]
    lengths = [length for g in gauges for length in g["length_mm"]]
    content["gauge"] |= {
        "length_mm": [min(lengths), max(lengths)],
        "noise_um": max(g.get("noise_um", 1.0) for g in gauges),
    }
    return replace(loaded, file=cell_file_of(content, str(loaded.path)))


PLACES_FILES = (
    ("cell.toml", "the cell with the best circles, ready to be planned"),
    ("places.csv", "every circle that was looked at"),
    ("places.json", "these figures for a program"),
)


@dataclass(frozen=True)
class CirclePlacesResult(FolderResult):
    """Where loaded circles tell the compliances apart.

    Attributes:
        cell: with the circle as it was given.
        found: the places.
        count: how many of them the written cell has.
        both: what the best of them and poses without load would know in one fit, where that was asked.
    """

    main_file = "places.json"
    cell: Cell
    found: CirclePlaceChoice
    count: int
    both: CommonFit | None = None
    stages: Stages = field(default_factory=Stages)

    def overview(self) -> Summary:
        """Return the overview: the places, and how well they determine the compliances."""
        facts = [("", s) for s in describe_places(self.found)]
        for name, unloaded, loaded, together in () if self.both is None else self.both.of("compliance"):
            circles = f"the {self.count} circles {share_text(loaded)}, in one fit {share_text(together)}"
            facts.append((name, f"without load {share_text(unloaded)}, {circles} of its prior sigma"))
        return Summary(f"{self.cell.name}: {len(self.found.pool)} places can be driven", facts)

    def content(self) -> Mapping[str, Any]:
        """Return what ``places.json`` says."""
        return places_content(self.found, self.cell.robot.name, self.both)

    def fill(self, draft: Path) -> None:
        """Write ``places.csv``, the pictures, and ``cell.toml`` with the best circles."""
        # plotting: other commands start quicker without
        from planner.report.loaded_report import draw_places
        from planner.report.page import report_overview

        with self.stages.stage("report"):
            write_text(draft / "places.csv", places_csv(self.found))
            write_cell(with_circles(self.cell, self.found.best_places(self.count)), draft)
            title, charts = f"Places of loaded circles for {self.cell.robot.title}", draw_places(self.found, self.count)
            report_overview(title, self.cell, self.overview().text(), charts, PLACES_FILES).write(draft)

    def files(self, folder: Path) -> str:
        """Name what is written."""
        return "places.json, places.csv, cell.toml, report.html"

    def next_step(self, folder: Path) -> str:
        """Say how the circles are driven."""
        return f"edbb plan {as_word(folder / 'cell.toml')} -o circles plans the {self.count} best circles"


@called_with(LoadedPlacesCall)
def study_places(asked: LoadedPlacesCall) -> CirclePlacesResult:
    """Study the places of a cell's loaded circle; with a plan without load also what one fit of both would know.

    Raises:
        InputError: the cell has no circle under load, or so many places make no sense.
        NoSolutionError: no circle can be followed, or fewer places than asked for.
        MissingProgramError: a package of planning is not installed.
    """
    require_planning_packages()
    count, unloaded, stages = asked.places, asked.unloaded, Stages(asked.progress)
    where = asked.cell if isinstance(asked.cell, Cell) else load_cell(str(asked.cell))
    with stages.stage("places"):
        # 6: places at least are looked at, so that it is seen what more of them would bring
        found = study_circle_places(where, max(count, 6), asked.seed)
    if count > len(found.sets):
        raise InputError(f"{count} places were asked for, but only {len(found.sets)} circles can be followed")
    places = found.best_places(count)
    both = None if unloaded is None else predict_common_fit(UnloadedPoses.read(unloaded), where, places)
    return CirclePlacesResult(where, found, count, both, stages)
