"""The verbs of circles, with and without load, declared."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from typing import Annotated

from planner.cell.declared import CellOption, CellWord
from planner.common.calls import Call, Dialects, Option, ProgressKeyword, Seed
from planner.common.progress import no_progress
from planner.workflow.core_calls import PLAN_STAGES
from planner.workflow.declared import RUNS, MeasuredPlan

MOST_PLACES = 12  # circles of one session


@dataclass(frozen=True)
class CircularCall(Call):
    """Evaluate a circular test in the manner of ISO 230-4: deviations, reversals, the polar plot."""

    verb = "circular"
    line = "Evaluate a circular test in the manner of ISO 230-4."
    group = "Calibrate"
    function = "planner.workflow.circle_evaluation:evaluate_circular_runs"

    runs: Annotated[Sequence[Path], RUNS]
    _: KW_ONLY
    plan: Annotated[Path, Option("the circular test that was measured, its cell.toml next to it", metavar="PLAN.json")]
    progress: ProgressKeyword = no_progress


@dataclass(frozen=True)
class LoadedCall(Call):
    """Evaluate circles driven under load: joint compliances, and the circle as it would be without load."""

    verb = "loaded"
    line = "Evaluate circles driven under load: joint compliances."
    group = "Calibrate"
    function = "planner.workflow.circle_evaluation:evaluate_loaded"

    runs: Annotated[Sequence[Path], replace(RUNS, help="runs with force_N, .csv or .parquet")]
    _: KW_ONLY
    cell: CellOption = None
    plan: MeasuredPlan = None
    tracker: Annotated[Path | None, Option("a tracker's run of the unloaded circle", metavar="RUN")] = None
    unloaded: Annotated[
        Sequence[Path], Option("a bar's run without load, for one fit of both", metavar="RUN", typed=list[Path] | None)
    ] = ()
    overshoot_deg: Annotated[
        float | None, Option("degrees dropped at either end (else as the cell says)", min=0.0, max=720.0)
    ] = None
    progress: ProgressKeyword = no_progress


@dataclass(frozen=True)
class LoadedPlacesCall(Call):
    """Find the places where loaded circles tell the joints' compliances apart."""

    verb = "loaded-places"
    line = "Find where loaded circles tell the compliances apart."
    group = "Plan"
    function = "planner.workflow.loaded_planning:study_places"

    cell: CellWord
    _: KW_ONLY
    places: Annotated[int, Option("circles of the cell.toml that is written", min=1, max=MOST_PLACES)] = 4
    unloaded: Annotated[Path | None, Option("a plan without load, for one fit of both", metavar="PLAN.json")] = None
    seed: Seed = 0
    progress: ProgressKeyword = no_progress


@dataclass(frozen=True)
class PlanBothCall(Call):
    """Plan a session with both bars: poses without load, and the loaded circles that add most to one fit of both."""

    verb = "plan-both"
    line = "Plan a session with an unloaded and a loaded bar."
    group = "Plan"
    function = "planner.workflow.loaded_planning:plan_both"
    starts = PLAN_STAGES

    unloaded: Annotated[
        str, Option("cell of the bar without load, or the plan.json of its plan", metavar="UNLOADED", is_word=True)
    ]
    loaded: Annotated[str, Option("cell of the loaded bar, with its circles", metavar="LOADED", is_word=True)]
    _: KW_ONLY
    places: Annotated[int, Option("circles of the loaded bar", min=1, max=MOST_PLACES)] = 3
    poses: Annotated[int | None, Option("number of poses without load", min=1)] = None
    seed: Seed = 0
    dialect: Dialects = ()
    progress: ProgressKeyword = no_progress
