"""What a person must know of a planned session and of its programs, beside what the plan itself shows."""

from collections.abc import Iterable

from planner.cell import Cell
from planner.plan import Course, is_continuous
from planner.program import info, program_notes
from planner.workflow.session import session


def session_notes(cell: Cell, courses: Iterable[Course], plan_id: str, dialects: Iterable[str]) -> tuple[str, ...]:
    """Return the notes of the session, then those of its program in each dialect; what several share is said once.

    Raises:
        InputError: no such dialect, or it cannot carry the session.
    """
    made = tuple(courses)
    said: dict[str, list[str]] = {}
    for name in dialects:
        for text in program_notes(session(cell, made, plan_id, info(name).wants_dense_path), name):
            said.setdefault(text, []).append(name)
    return (*_repeats(cell), *(f"{', '.join(names)}: {text}" for text, names in said.items()))


def _repeats(cell: Cell) -> list[str]:
    """Repeats are visits at rest; who asked for them is told what stands in for them while moving."""
    asked = cell.plan.repeat and "repeat" in cell.file.plan.model_fields_set
    if not asked or not is_continuous(cell):
        return []
    instead = "every pose is passed twice, there and back" if cell.motion.both_ways else "no pose is visited twice"
    return [f"plan.repeat = {cell.plan.repeat} is for poses at rest: in this continuous session {instead}"]
