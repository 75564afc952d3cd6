"""Reads robot programs back, without the templates and the code that wrote them."""

from collections.abc import Callable

import planner.programs.languages.gcode as gcode
import planner.programs.languages.krl as krl
import planner.programs.languages.pdl2 as pdl2
import planner.programs.languages.rapid as rapid
from planner.programs.dialect import Dialect
from planner.programs.languages.execution import ExecutionTrace, ReadBack, plan_id_of

READERS: dict[str, Callable[[Dialect, tuple[str, ...], ExecutionTrace], None]] = {
    "gcode": gcode.read,
    "krl": krl.read,
    "rapid": rapid.read,
    "pdl2": pdl2.read,
}


def read_texts(dialect: Dialect, texts: tuple[str, ...]) -> ReadBack:
    """Return what the files ``texts`` make the robot do; the first is the one that is started.

    Raises:
        InputError: a line that is not of the language, or no plan_id, or two different ones.
    """
    trace = ExecutionTrace()
    READERS[dialect.reading.family](dialect, texts, trace)
    return trace.finished(plan_id_of(texts))
