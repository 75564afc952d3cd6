"""Comau PDL2: joint targets in braces, ``MOVE TO {10, -20, …}`` and ``MOVEFLY TO {…} ADVANCE``."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import planner.programs.languages.statements as st
from planner.common.errors import InputError
from planner.programs.dialect import Dialect
from planner.programs.instructions import Program
from planner.programs.languages.execution import Execution
from planner.programs.languages.text import EXPONENT_NUMBER, Lines, mask_comments

MAIN = "PROGRAM"  # the routine that the program's own body counts as
_MOVE = re.compile(
    r"\s*(?P<word>MOVE(?:FLY)?)\b(?P<how>[^{\n]*?)\b(?P<to>TO|VIA)\s*(?P<target>\{[^}]*\}|[^\r\n]*)(?P<rest>.*)",
    re.IGNORECASE | re.DOTALL,
)
_PROGRAM = re.compile(r"PROGRAM (\w+)(?: .*)?")
_ROUTINE = re.compile(r"ROUTINE (\w+)(?:\(.*\))?")
_ASSIGNED = re.compile(r"(\$?\w+(?:\[[^\]]*\])?) := (.+)")
_PASSIVE = re.compile(r"(?:VAR|PAUSE|WAIT FOR .*|(?:OPEN|CLOSE) FILE .*|WRITE .*|\w+\(.*\)|\w+ : \w+)")


@dataclass(frozen=True)
class Pdl2Move(st.MotionStatement):
    """A move: words before the target, the target, its numbers (None where it holds others), and what follows."""

    how: str
    target: str
    numbers: tuple[st.PlacedNumber, ...] | None
    rest: str


def parse(text: str) -> Iterator[st.Statement]:
    """Yield the statements; a move with its WITH clauses up to ENDMOVE is one, and so is a condition."""
    program = owner = ""
    for line, start, code in _join_lines(mask_comments(text, r"--[^\r\n]*", "'")):
        place = line, start + len(code) - len(code.lstrip()), code.strip()
        said = place[2]
        if re.match(r"MOVE(FLY)?\b", said, re.IGNORECASE):
            yield _move(code, line, start)
        elif match := _PROGRAM.fullmatch(said):
            program = owner = match[1]
        elif match := _ROUTINE.fullmatch(said):
            owner = match[1]
        elif said == "BEGIN":
            yield st.Routine(*place, MAIN if owner == program else owner)
        elif said == f"END {owner}":
            owner = program
            yield st.RoutineEnd(*place)
        else:
            yield _statement(place)


def _statement(place: tuple[int, int, str]) -> st.Statement:
    said = place[2]
    if match := re.fullmatch(r"DELAY (\S+)", said):
        return st.Waiting(*place, match[1], 1e-3)
    if said.startswith("PULSE "):
        return st.Pulse(*place)
    if match := _ASSIGNED.fullmatch(said):
        return st.Assignment(*place, "", match[1], "", match[2], place[1] + match.start(2))
    if said.startswith("CONDITION[") or _PASSIVE.fullmatch(said):
        return st.Passive(*place)
    return st.Call(*place, said) if re.fullmatch(r"\w+", said) else st.Statement(*place)


def _join_lines(text: str) -> Iterator[tuple[int, int, str]]:
    """Yield line, place and text of statements, those that go over several lines as one."""
    begun: tuple[int, int] | None = None
    closing = ""
    for line, start, code in Lines.of(text):
        said = code.strip()
        if begun is None and said:
            begun = line, start
            closing = "ENDCONDITION" if said.startswith("CONDITION[") else ""
            closing = "ENDMOVE" if said.startswith("MOVE") and said.endswith(",") else closing
        if begun is not None and (not closing or said == closing):
            yield *begun, text[begun[1] : start + len(code)]
            begun = None
    if begun is not None:
        yield *begun, text[begun[1] :]


def _move(code: str, line: int, start: int) -> Pdl2Move:
    match = _MOVE.match(code)
    if match is None:
        return Pdl2Move(line, start, code.strip(), "MOVE", "", "", None, "")
    inside = match["target"][1:-1]
    plain = match["target"].startswith("{") and re.fullmatch(
        rf"\s*{EXPONENT_NUMBER}\s*(,\s*{EXPONENT_NUMBER}\s*)*", inside
    )
    numbers = tuple(st.placed_numbers(inside, start + match.start("target") + 1, EXPONENT_NUMBER))
    word, how, target = match["word"].upper(), match["how"].strip(), match["target"]
    how = "VIA" if match["to"].upper() == "VIA" else how
    return Pdl2Move(line, start, code.strip(), word, how, target, numbers if plain else None, match["rest"].strip())


class Pdl2Execution(Execution):
    """The predefined variables that a joint move takes its speed and its rounding from."""

    def __init__(self, dialect: Dialect, program: Program | None = None) -> None:
        super().__init__(dialect, program)
        self.arm_percent: float | None = None  # where the program sets none, the operator has

    def forget(self, stopped: bool) -> None:
        """Forget the override at a stop, where the program sets one."""
        self.arm_percent = math.nan if stopped and self.arm_percent is not None else self.arm_percent

    @property
    def overall_speed(self) -> float:
        """Return the arm's override."""
        return 100.0 if self.arm_percent is None else self.arm_percent

    def parse(self, texts: Sequence[str]) -> Iterator[st.Statement]:
        """Yield the statements of the one file."""
        return parse(texts[0])

    def order(self, statements: Sequence[st.Statement]) -> Iterator[st.Statement]:
        """Yield the statements of the program's own body."""
        return st.run_order(statements, MAIN)

    def execute(self, statement: st.Statement) -> bool:
        """Take in a move or what decides how it is driven; motions other than joint moves raise InputError."""
        match statement:
            case Pdl2Move():
                self._move(statement)
            case st.Assignment(name="$ARM_SPD_OVR", value="kept_ovr"):
                self.arm_percent = math.nan  # as it was found: no move may follow
            case st.Assignment(name="$ARM_SPD_OVR", value=value):
                self.arm_percent = st.parse_fixed(value, statement.text)
            case _:
                return False
        return True

    def _move(self, move: Pdl2Move) -> None:
        clauses = re.fullmatch(r"(?:ADVANCE)?(?:,?\s*WITH (.*))?", move.rest, re.DOTALL)
        if move.how or move.numbers is None or clauses is None:
            raise InputError(f"'{move.text}' is no joint move of this family")
        said = clauses[1] or ""
        fly = re.search(r"\$FLY_PER = (\d+)", said)
        speed = re.search(r"\$PROG_SPD_OVR = (\d+)", said)
        if (move.word == "MOVE") != (fly is None) or speed is None:
            raise InputError(f"'{move.text}': MOVEFLY and $FLY_PER belong together, and every move has its speed")
        angles = [st.parse_fixed(number.text, move.text) for number in move.numbers]
        self.move(angles, None if fly is None else float(fly[1]), float(speed[1]) * self.overall_speed / 100.0)
        self.syncs += said.count("CONDITION[")
