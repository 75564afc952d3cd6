"""KUKA KRL: ``PTP {A1 ..., A2 ...}`` with or without ``C_PTP``; parts are DEFs, in one file or several."""

import re

from planner.common.errors import InputError
from planner.programs.dialect import Dialect
from planner.programs.languages.execution import ExecutionTrace, inline_calls, parse_fixed

_AXES = [f"A{i}" for i in range(1, 7)] + [f"E{i}" for i in range(1, 7)]
_SETTING = re.compile(r"(\$OV_PRO|\$APO\.CPTP)\s*=\s*(\S+)|BAS\s*\(\s*(#VEL_PTP)\s*,\s*(\S+?)\s*\)")
_CALL = re.compile(r"(?:TRIGGER\s+WHEN\s.*\bDO\s+)?([A-Za-z_$][\w$]*)\s*\(\s*\)(?:\s+PRIO\s*=\s*-?\d+)?")
_SCALED = re.compile(r"\(\w+\*(\d+)\+99\)/100")
_FOUND = re.compile(r"OV_\w+")


def read(dialect: Dialect, texts: tuple[str, ...], trace: ExecutionTrace) -> None:
    """Note the moves of the first DEF of the first file and of those that it calls."""
    bodies: dict[str, list[str]] = {}
    for text in texts:
        _collect_routines(text, bodies)
    if not bodies:
        raise InputError("no DEF in the program")
    machine = _KrlMachine(trace, dialect.reading.centre)
    for statement in inline_calls(bodies, next(iter(bodies)), _called_routine):
        machine.run(statement)


def _called_routine(statement: str) -> str | None:
    match = _CALL.fullmatch(statement)
    return match[1].upper() if match else None


def _collect_routines(text: str, bodies: dict[str, list[str]]) -> None:
    body: list[str] | None = None
    for line in text.splitlines():
        statement = line.split(";", 1)[0].strip()
        if match := re.fullmatch(r"(?:GLOBAL\s+)?DEF\s+(\w{1,24})\s*\(\s*\)", statement, re.IGNORECASE):
            body = bodies[match[1].upper()] = []
        elif statement.upper() == "END":
            body = None
        elif body is not None and statement:
            body.append(statement)
    if body is not None:
        raise InputError("a DEF has no END")


class _KrlMachine:
    """The system variables that a PTP move takes its speed and its rounding from."""

    def __init__(self, trace: ExecutionTrace, centring: str = "") -> None:
        self.trace, self.centring = trace, centring
        self.values = {"$OV_PRO": 100.0, "$APO.CPTP": 0.0, "#VEL_PTP": 100.0}

    def run(self, statement: str) -> None:
        """Execute one statement, if it moves, waits, pulses or sets a speed; raises InputError for other moves."""
        if match := re.fullmatch(r"PTP\s*\{(.*)\}\s*(C_PTP)?", statement, re.IGNORECASE):
            speed = self.values["#VEL_PTP"] * self.values["$OV_PRO"] / 100.0
            self.trace.move(_angles(match[1]), self.values["$APO.CPTP"] if match[2] else None, speed)
        elif re.match(r"(S?PTP|S?LIN|S?CIRC)(_REL)?\b", statement, re.IGNORECASE):
            raise InputError(f"'{statement}' is no joint move of this family")
        elif match := re.fullmatch(r"WAIT\s+SEC\s+(\S+)", statement, re.IGNORECASE):
            self.trace.dwell(parse_fixed(match[1], statement))
        elif re.match(r"(TRIGGER\s+WHEN\s+.*\bDO\s+)?PULSE\s*\(", statement, re.IGNORECASE):
            self.trace.syncs += 1
        elif self.centring and (match := re.fullmatch(self.centring, statement, re.IGNORECASE)):
            self.trace.centring(int(match["ball"]), int(match["pose"]))
        elif match := _SETTING.fullmatch(statement):
            self.values[match[1] or match[3]] = _percentage(match[2] or match[4], statement)


def _percentage(text: str, statement: str) -> float:
    """Return the number; of the override that the operator had set, taken as 100, where it is scaled or given back."""
    if scaled := _SCALED.fullmatch(text):
        return parse_fixed(scaled[1], statement)
    return 100.0 if _FOUND.fullmatch(text) else parse_fixed(text, statement)


def _angles(aggregate: str) -> list[float]:
    found: dict[str, float] = {}
    for element in aggregate.split(","):
        name, _, value = element.strip().partition(" ")
        if name in found:
            raise InputError(f"{name} stands twice in {{{aggregate}}}")
        found[name] = parse_fixed(value.strip(), aggregate)
    if list(found) != _AXES[: len(found)]:
        raise InputError(f"{{{aggregate}}} does not name the axes in order")
    return list(found.values())
