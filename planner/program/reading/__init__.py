"""Reads robot programs back, without the templates and the code that wrote them: one file a language family."""

from collections.abc import Callable

from planner.program.dialect import Dialect
from planner.program.reading import gcode, krl, pdl2, rapid
from planner.program.reading.trace import ReadBack, Trace, plan_id_of

READERS: dict[str, Callable[[Dialect, tuple[str, ...], Trace], None]] = {
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
    trace = Trace()
    READERS[dialect.reading.family](dialect, texts, trace)
    return trace.finished(plan_id_of(texts))


__all__ = ["ReadBack", "read_texts"]
