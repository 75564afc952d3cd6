"""Reads robot programs back, without the templates and the code that wrote them."""

import re

from planner.common.errors import InputError
from planner.programs.dialect import Dialect
from planner.programs.instructions import Program
from planner.programs.languages import fanuc, frames, gcode, krl, listing, pdl2, rapid, trajectory, urscript
from planner.programs.languages.execution import Execution, ReadBack

EXECUTIONS: dict[str, type[Execution]] = {
    "gcode": gcode.GcodeExecution,
    "krl": krl.KrlExecution,
    "rapid": rapid.RapidExecution,
    "pdl2": pdl2.Pdl2Execution,
    "urscript": urscript.UrScriptExecution,
    "fanuc": fanuc.FanucExecution,
    "list": listing.ListExecution,
    "trajectory": trajectory.TrajectoryExecution,
    "frames": frames.FramesExecution,
}


def read_texts(
    dialect: Dialect, texts: tuple[str, ...], program: Program | None = None, only_known: bool = True
) -> ReadBack:
    """Return what the files ``texts`` make the robot do; the first is the one that is started.

    Args:
        dialect: the dialect that they are written in.
        texts: of the files.
        program: what they were written for; only its own tool, base, load and signals are known then.
        only_known: refuse a statement that the reader does not know, instead of passing it over.

    Raises:
        InputError: a line that is not of the language, or no plan_id, or two different ones.
    """
    execution = EXECUTIONS[dialect.reading.family](dialect, program)
    execution.run(texts)
    if only_known and execution.unknown:
        unknown = execution.unknown[0]
        raise InputError(f"line {unknown.line}: the reader does not know the statement '{unknown.text}'")
    return execution.result(_plan_id_of(texts))


def _plan_id_of(texts: tuple[str, ...]) -> str:
    """Return the plan_id that every one of the files names in a comment."""
    found: set[str] = {m for text in texts for m in re.findall(r'plan_id"?:\s*"?([0-9a-f]{12})\b', text)}
    unnamed = [n for n, text in enumerate(texts, start=1) if not re.search('plan_id"?:', text)]
    if len(found) != 1 or unnamed:
        raise InputError(f"every file must name the same plan_id, found {sorted(found) or 'none'}")
    return found.pop()
