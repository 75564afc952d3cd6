"""What to do at the cell, from an empty one to a saved log; what concerns the gauge, the gauge says."""

from dataclasses import dataclass
from pathlib import Path

from planner.cell.file import CellFile
from planner.cell.gauge_types import CellStep
from planner.cell.reading import gauge_class
from planner.instruments.circular.document import CircularDocument
from planner.report.formatting import duration_text
from planner.service.answers import OutputFile
from planner.service.page_content import AnyPlan


@dataclass(frozen=True)
class SessionStep(CellStep):
    """One step, and the files that it needs."""

    files: tuple[OutputFile, ...] = ()


def session_steps(plan: AnyPlan, cell: CellFile, files: list[OutputFile]) -> list[CellStep]:
    """Return the steps from an empty cell to a saved log, in order."""
    guide = gauge_class(cell).session_guide(cell)
    lasts = f"for {duration_text(plan.trajectory.duration_s)} " if plan.trajectory else ""
    if isinstance(plan, CircularDocument):
        what, row = f"the circles ({len(plan.circles)}) as often as the program says", "sample"
    else:
        stops = len(plan.ids("mount"))
        also = f" and {stops} stop{'s' * (stops > 1)} for the gauge" if stops else ""
        what = f"{len(plan.poses) - stops} poses{also}"
        row = "pose" if cell.motion.measure == "static" else "sample"
    return [
        CellStep(
            "Clear the cell",
            "Nobody and nothing stands within reach that the cell file does not name. Keep the stop at hand.",
        ),
        CellStep("Switch off what corrects", "Accuracy options of the controller are off."),
        SessionStep(
            "Bring the program to the controller",
            f"It bears the plan {plan.plan_id} in its first lines.",
            _programs(plan, files),
        ),
        *guide.before,
        CellStep("Warm up", "Drive for half an hour as in work, so that the robot is as warm as when it works."),
        CellStep(
            "Drive to the start slowly",
            "Run the first move at low override and watch: the way from where the robot stands to home is not planned.",
        ),
        *guide.at_start,
        CellStep("Start the log", f"One row a {row}: time, joint angles as read, {guide.logged}."),
        CellStep("Run the program", f"It drives {lasts}through {what}. {guide.at_poses}"),
        *guide.after,
        CellStep("Save the log", f"As CSV, with the line '# plan_id: {plan.plan_id}' above the columns."),
    ]


def _programs(plan: AnyPlan, files: list[OutputFile]) -> tuple[OutputFile, ...]:
    """The programs of the plan, with the files that go with them."""
    stems = {Path(p["file"]).stem for p in plan.programs}
    return tuple(f for f in files if any(f.name.startswith(s) for s in stems))
