"""Comau PDL2: joint targets in braces, ``MOVE TO {10, -20, …}`` and ``MOVEFLY TO {…} ADVANCE``."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import planner.programs.languages.statements as st
from planner.common.errors import InputError
from planner.programs.dialect import Dialect
from planner.programs.instructions import Program
from planner.programs.languages.execution import Execution

MAIN = "PROGRAM"  # the routine that the program's own body counts as
_MOVE = re.compile(
    r"\s*(?P<word>MOVE(?:FLY)?)\b(?P<how>[^{\n]*?)\b(?P<to>TO|VIA)\s*(?P<target>\{[^}]*\}|[^\r\n]*)(?P<rest>.*)",
    re.IGNORECASE | re.DOTALL,
)
_PROGRAM = re.compile(r"PROGRAM (\w+)(?: .*)?")
_ROUTINE = re.compile(r"ROUTINE (\w+)(?:\(.*\))?(?: : \w+)?")
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
    for line, start, code in _join_lines(st.mask_comments(text, r"--[^\r\n]*", "'")):
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
    for line, start, code in st.Lines.of(text):
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
        rf"\s*{st.EXPONENT_NUMBER}\s*(,\s*{st.EXPONENT_NUMBER}\s*)*", inside
    )
    numbers = tuple(st.placed_numbers(inside, start + match.start("target") + 1, st.EXPONENT_NUMBER))
    word, how, target = match["word"].upper(), match["how"].strip(), match["target"]
    how = "VIA" if match["to"].upper() == "VIA" else how
    return Pdl2Move(line, start, code.strip(), word, how, target, numbers if plain else None, match["rest"].strip())


class Pdl2Execution(Execution, family="pdl2"):
    """Every move says its own speed and rounding (WITH); a circle's two places are variables that hold joint angles."""

    parse_file = staticmethod(parse)

    def __init__(self, dialect: Dialect, program: Program | None = None) -> None:
        super().__init__(dialect, program)
        self.places: dict[str, list[float]] = {}

    def order(self, statements: Sequence[st.Statement]) -> Iterator[st.Statement]:
        """Yield the statements of the program's own body."""
        return st.run_order(statements, MAIN)

    def execute(self, statement: st.Statement) -> bool:
        """Process a move or a place of one; motions other than joint moves and circles raise InputError."""
        match statement:
            case Pdl2Move():
                self._move(statement)
            case st.Assignment(name=name, value=value) if found := re.fullmatch(r"place\((.*)\)", value):
                self.places[name] = [st.parse_fixed_point(cell.strip(), statement.text) for cell in found[1].split(",")]
            case _:
                return False
        return True

    def _move(self, move: Pdl2Move) -> None:
        if move.how == "CIRCULAR":
            self._circle(move)
            return
        if move.how or move.numbers is None:
            raise _refusal(move)
        said = _clauses(move, move.rest, ("$PROG_SPD_OVR",), ("$FLY_PER",), ("$ARM_SPD_OVR",))
        speed = said["$PROG_SPD_OVR"] * said.get("$ARM_SPD_OVR", 100.0) / 100.0
        self.move(
            [st.parse_fixed_point(number.text, move.text) for number in move.numbers], said.get("$FLY_PER"), speed
        )
        self.syncs += move.rest.count("CONDITION[")

    def _circle(self, move: Pdl2Move) -> None:
        found = re.fullmatch(r"(\w+)\s+VIA\s+(\w+)(.*)", f"{move.target}{move.rest}", re.DOTALL)
        if found is None or not {found[1], found[2]} <= self.places.keys():
            raise _refusal(move)
        said = _clauses(move, found[3].strip(), ("$PROG_SPD_OVR", "$LIN_SPD"), ("$FLY_TYPE", "$FLY_TRAJ", "$FLY_DIST"))
        via, goal = self.places.pop(found[2]), self.places.pop(found[1])
        self.move(goal, said.get("$FLY_DIST"), 1e3 * said["$LIN_SPD"] * said["$PROG_SPD_OVR"] / 100.0, via)
        self.syncs += found[3].count("CONDITION[")


_WORDS = {"$FLY_TYPE": "FLY_CART", "$FLY_TRAJ": "FLY_TOL"}  # values that are no numbers, and which they must be


def _clauses(
    move: Pdl2Move, text: str, always: tuple[str, ...], flying: tuple[str, ...], maybe: tuple[str, ...] = ()
) -> dict[str, float]:
    """Return the values that hold for the one move; ``flying`` are those of MOVEFLY alone."""
    clauses = re.fullmatch(r"(?:ADVANCE)?(?:,?\s*WITH (.*))?", text, re.DOTALL)
    said = dict(re.findall(r"(\$\w+) = ([\w.]+)", clauses[1] or "" if clauses else ""))
    wanted = {*always, *(flying if move.word == "MOVEFLY" else ())}
    if clauses is None or not wanted <= said.keys() <= {*wanted, *maybe}:
        raise InputError(f"'{move.text}': MOVEFLY and its rounding belong together, and every move has its speed")
    if any(said[word] != value for word, value in _WORDS.items() if word in said):
        raise _refusal(move)
    return {word: st.parse_fixed_point(value, move.text) for word, value in said.items() if word not in _WORDS}


def _refusal(move: Pdl2Move) -> InputError:
    return InputError(f"'{move.text}' is no joint move of this family")
