"""How verbs are told plans, runs and calibrated robots."""

from pathlib import Path
from typing import Annotated

from planner.common.calls import JobFile, Option

RUNS = Option("measured runs, .csv or .parquet", metavar="RUN...", is_word=True, typed=list[Path])
PLAN_FILE = Option("a plan with its cell.toml next to it", metavar="PLAN.json", is_word=True, typed=Path)
MEASURED = Option("the plan that was measured", metavar="PLAN.json", typed=Path | None)
MeasuredPlan = Annotated[Path | str | None, MEASURED]
CALIBRATED = Option(
    "the calibrated robot: the folder that edbb identify wrote, or its robot.toml",
    metavar="CALIBRATED",
    typed=Path,
    from_service=JobFile("identification", "calibrated", "robot.toml"),
)
