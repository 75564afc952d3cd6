"""What a person must know of a planned session and of its programs, beside what the plan itself shows."""

from collections.abc import Iterable

import numpy as np

from planner.cell import Cell
from planner.plan import Course, Drive, is_continuous
from planner.program import info, program_notes
from planner.units import to_mm
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
    return (*_repeats(cell), *_speeds(cell), *(f"{', '.join(names)}: {text}" for text, names in said.items()))


def bar_notes(cell: Cell, drives: Iterable[Drive]) -> tuple[str, ...]:
    """Return what is to be told of poses nearer to the bar's ends than is known where it hangs."""
    low, high, out = cell.gauge.length_min, cell.gauge.length_max, []
    for drive in drives:
        prior = float(np.hypot(cell.fixtures[drive.fixture].prior, cell.tool.prior))
        room = [min(v.length - low, high - v.length) for v in drive.visits if v.role != "mount"]
        near = sum(r < prior for r in room)
        if near:
            out.append(
                f"{near} of {len(room)} poses at fixture {cell.place_name(drive.fixture)} come within "
                f"{to_mm(prior):.2g} mm of the bar's ends, and it is known no better where fixture and tool point are "
                "(their prior_mm): measure both first, or narrow gauge.length_mm, so that the bar meets no stop"
            )
    return tuple(out)


def _speeds(cell: Cell) -> list[str]:
    """Programs name one tool; who measures at several points of it is told which one."""
    if not cell.tool.points:
        return []
    first = cell.tool.points[0].name
    return [f"the tool's point in a program, and its speed, are those of tool point {first} at all places of the bar"]


def _repeats(cell: Cell) -> list[str]:
    """Repeats are visits at rest; who asked for them is told what stands in for them while moving."""
    asked = cell.plan.repeat and "repeat" in cell.file.plan.model_fields_set
    if not asked or not is_continuous(cell):
        return []
    instead = "every pose is passed twice, there and back" if cell.motion.both_ways else "no pose is visited twice"
    return [f"plan.repeat = {cell.plan.repeat} is for poses at rest: in this continuous session {instead}"]
