"""ABB RAPID: ``MoveAbsJ [[...],[...]], speed, zone, tool;`` in PROCs of one module."""

import re

from planner.common.errors import InputError
from planner.programs.dialect import Dialect
from planner.programs.languages.execution import ExecutionTrace, inline_calls, parse_fixed

_MOVE = re.compile(
    r"MoveAbsJ \[\[(?P<robot>[^]]*)\],\[(?P<external>[^]]*)\]\], \[(?P<speed>[^],]*),[^]]*\], "
    r"(?P<zone>fine|\[FALSE,(?P<distance>[^],]*),[^]]*\]), \w+( \\WObj:=\w+)?"
)
_UNUSED = "9E9"


def read(_dialect: Dialect, texts: tuple[str, ...], trace: ExecutionTrace) -> None:
    """Note the moves of PROC main and of the PROCs that it calls."""
    bodies: dict[str, list[str]] = {}
    body: list[str] | None = None
    for line in texts[0].splitlines():
        statement = line.split("!", 1)[0].strip()
        if match := re.fullmatch(r"PROC\s+(\w+)\s*\(.*\)", statement):
            body = bodies[match[1].lower()] = []
        elif statement == "ENDPROC":
            body = None
        elif body is not None and statement:
            body.append(statement)
    if body is not None or "main" not in bodies:
        raise InputError("the module has no complete PROC main")
    for statement in inline_calls(bodies, "main", _called_routine):
        _statement(statement, trace)


def _called_routine(statement: str) -> str | None:
    match = re.fullmatch(r"(\w+)(?: \d+)?;", statement)
    return match[1].lower() if match else None


def _statement(statement: str, trace: ExecutionTrace) -> None:
    if statement.startswith("Move"):
        match = _MOVE.fullmatch(statement.removesuffix(";"))
        if match is None:
            raise InputError(f"'{statement}' is no joint move of this family")
        external = [v for v in match["external"].split(",") if v != _UNUSED]
        angles = [parse_fixed(v, statement) for v in (*match["robot"].split(","), *external)]
        blend = None if match["zone"] == "fine" else parse_fixed(match["distance"], statement)
        trace.move(angles, blend, parse_fixed(match["speed"], statement))
    elif match := re.fullmatch(r"WaitTime (\S+);", statement):
        trace.dwell(parse_fixed(match[1], statement))
    elif statement.startswith("PulseDO "):
        trace.syncs += 1
