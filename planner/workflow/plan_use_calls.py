"""The verbs ``export``, ``simulate`` and ``import``, declared."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from planner.common.calls import LANGUAGE, Call, Option, Seed
from planner.workflow.declared import PLAN_FILE, MeasuredPlan

if TYPE_CHECKING:
    from planner.workflow.plan_results import PosesResult, SessionResult


@dataclass(frozen=True)
class ExportCall(Call):
    """Write the robot program of a plan in any dialect; the cell.toml next to the plan must be the plan's own."""

    verb = "export"
    line = "Write the robot program of a plan in any dialect."
    group = "Use"
    function = "planner.workflow.plan_use:export"

    plan: Annotated[Path | str, PLAN_FILE]
    _: KW_ONLY
    dialect: Annotated[str, Option("robot language", pattern=LANGUAGE)]
    name: Annotated[
        str, Option("of the file, where the program is to be called as it is; ``-``: the plan's own", python_only=True)
    ] = "-"


@dataclass(frozen=True)
class SimulateCall(Call):
    """Simulate the measured run of a plan, on a robot with known or drawn errors."""

    verb = "simulate"
    line = "Simulate the measured run of a plan."
    group = "Measure"
    function = "planner.workflow.plan_use:simulate"

    plan: Annotated["SessionResult | PosesResult | Path | str", PLAN_FILE]
    _: KW_ONLY
    truth: Annotated[
        "Path | str | Mapping[str, Any] | None",
        Option(
            "errors of the simulated robot: a TOML file, or its run as CSV",
            metavar="TRUTH",
            typed=Path | None,
        ),
    ] = None
    change: Annotated[
        str,
        Option(
            "added to an error of the truth, as in theta3_deg=0.2",
            metavar="KEY=VALUE",
            pattern=r"^[a-z]+[a-z0-9_]{0,40}=-?[0-9]{1,6}(\.[0-9]{1,9})?$",
        ),
    ] = ""
    seed: Seed = 0


@dataclass(frozen=True)
class ImportCall(Call):
    """Bring traces into the run format: by a map, the log of a plan's own program, or images of a camera's board."""

    verb = "import"
    line = "Bring controller and gauge traces into the run format."
    group = "Measure"
    function = "planner.workflow.plan_use:import_traces"

    traces: Annotated[
        Sequence[Path | str],
        Option(
            "controller and gauge traces; with --images a table of the joint angles",
            metavar="TRACE...",
            is_word=True,
            typed=list[Path],
        ),
    ]
    _: KW_ONLY
    map_file: Annotated[
        Path | str | None, Option("which column is what", metavar="MAP.toml", flag="--map", typed=Path | None)
    ] = None
    plan: MeasuredPlan = None
    dialect: Annotated[str | None, Option("of the plan's program, whose own log is the first trace")] = None
    images: Annotated[
        Path | str | None,
        Option(
            "folder of images whose names end in the numbers of their poses",
            metavar="DIR",
            typed=Path | None,
            is_served=False,
        ),
    ] = None
    board: Annotated[
        Path | str | None,
        Option(
            "the board in the images, or the cell with it", metavar="board.toml", typed=Path | None, is_served=False
        ),
    ] = None
