"""Comau PDL2: ``MOVE TO {...}`` and ``MOVEFLY TO {...} ADVANCE``; parts are routines of the same program."""

import re

from planner.common.errors import InputError
from planner.programs.dialect import Dialect
from planner.programs.languages.execution import ExecutionTrace, inline_calls, parse_fixed

_MOVE = re.compile(r"MOVE(FLY)? TO \{([^}]*)\}(?: ADVANCE)?(?:,? WITH (.*))?")


def read(_dialect: Dialect, texts: tuple[str, ...], trace: ExecutionTrace) -> None:
    """Note the moves of the program's own body and of the routines that it calls."""
    statements = _join_statements(texts[0])
    program = re.fullmatch(r"PROGRAM (\w+)(?: .*)?", statements[0])
    if program is None:
        raise InputError(f"'{statements[0]}' does not begin a program")
    bodies: dict[str, list[str]] = {}
    owner, body = program[1], None
    for statement in statements[1:]:
        if match := re.fullmatch(r"ROUTINE (\w+)(?:\(.*\))?", statement):
            owner = match[1]
        elif statement == "BEGIN":
            body = bodies[owner] = []
        elif statement == f"END {owner}":
            owner, body = program[1], None
        elif body is not None:
            body.append(statement)
    if program[1] not in bodies or body is not None:
        raise InputError(f"the program {program[1]} has no complete body")
    machine = _Pdl2Machine(trace)
    for statement in inline_calls(bodies, program[1], lambda s: s if re.fullmatch(r"\w+", s) else None):
        machine.run(statement)


def _join_statements(text: str) -> list[str]:
    """Return the statements; a move with its WITH clauses up to ENDMOVE is one, a condition is none."""
    statements: list[str] = []
    inside = ""
    for line in text.splitlines():
        statement = line.split("--", 1)[0].strip()
        if statement.startswith("CONDITION["):
            inside = "ENDCONDITION"
        elif inside == "ENDMOVE" and statement != inside:
            statements[-1] += f" {statement}"
        elif not inside and statement:
            statements.append(statement)
            inside = "ENDMOVE" if statement.startswith("MOVE") and statement.endswith(",") else ""
        if statement == inside:
            inside = ""
    return statements


class _Pdl2Machine:
    """The predefined variables that a joint move takes its speed and its rounding from."""

    def __init__(self, trace: ExecutionTrace) -> None:
        self.trace = trace
        self.arm_percent = 100.0

    def run(self, statement: str) -> None:
        """Execute one statement: moves, speeds in percent, waits [ms] and pulses."""
        if statement.startswith("MOVE"):
            self._move(statement)
        elif match := re.fullmatch(r"\$ARM_SPD_OVR := (\S+)", statement):
            self.arm_percent = parse_fixed(match[1], statement)
        elif match := re.fullmatch(r"DELAY (\S+)", statement):
            self.trace.dwell(parse_fixed(match[1], statement) / 1000.0)
        elif statement.startswith("PULSE "):
            self.trace.syncs += 1

    def _move(self, statement: str) -> None:
        match = _MOVE.fullmatch(statement)
        if match is None:
            raise InputError(f"'{statement}' is no joint move of this family")
        clauses = match[3] or ""
        fly = re.search(r"\$FLY_PER = (\d+)", clauses)
        speed = re.search(r"\$PROG_SPD_OVR = (\d+)", clauses)
        if (match[1] is None) != (fly is None) or speed is None:
            raise InputError(f"'{statement}': MOVEFLY and $FLY_PER belong together, and every move has its speed")
        angles = [parse_fixed(v.strip(), statement) for v in match[2].split(",")]
        self.trace.move(angles, None if fly is None else float(fly[1]), float(speed[1]) * self.arm_percent / 100.0)
        self.trace.syncs += clauses.count("CONDITION[")
