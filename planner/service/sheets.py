"""What to do at the cell, from an empty one to a saved log, as a checklist says it."""

from pathlib import Path

from planner.cell.file import CellFile
from planner.cell.reading import gauge_class
from planner.service.answers import OutputFile
from planner.service.page_content import AnyPlan


def session_content(plan: AnyPlan, cell: CellFile, files: list[OutputFile]) -> dict[str, object]:
    """Return what the checklist from an empty cell to a saved log says of a plan; files of a program share its name."""
    stems, gauge = tuple(Path(p.file).stem for p in plan.programs), gauge_class(cell)
    return {
        "plan": plan,
        "guide": gauge.session_guide(cell),
        "reading": gauge.reading_text(cell),
        "by_hand": cell.gauge.read_by == "hand" and gauge.columns == "length_mm",
        "programs": [f for f in files if f.name.startswith(stems)],
        "static": cell.motion.measure == "static",
    }
