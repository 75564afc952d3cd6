"""FANUC TP as ASCII (.LS): numbered statements under /MN, the joint angles of their positions under /POS."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import planner.programs.languages.statements as st
from planner.common.errors import InputError
from planner.programs.dialect import Dialect
from planner.programs.instructions import Program
from planner.programs.languages.execution import Execution

_NUMBERED = re.compile(r"\s*(?:\d+\s*)?:\s*")
_MOTION = re.compile(r"[JLCAS] P(?:R)?\[.*")
_MOVE = re.compile(rf"J P\[(?P<number>\d+)\] (?P<speed>{st.NUMBER})(?P<unit>sec|%) (?P<end>FINE|CNT\d+)")
_MESSAGE = re.compile(r"MESSAGE\[[^\[\];]*\]")  # shows its text, like a remark
_AXIS = rf"(?:J\d|E\d)\s*=\s*({st.NUMBER})\s*deg"
_POSITION = re.compile(
    r"P\[(?P<number>\d+)\]\{\s*GP1:\s*UF : (?P<frame>\d+), UT : (?P<tool>\d+),\s*"
    rf"(?P<axes>{_AXIS}(?:,\s*{_AXIS})*)\s*\}};"
)


@dataclass(frozen=True)
class TpPosition(st.Statement):
    """A taught position: its number and its joint angles [deg]."""

    number: int
    angles: tuple[float, ...]


@dataclass(frozen=True)
class TpMove(st.MotionStatement):
    """A motion of any kind."""


def parse(text: str) -> Iterator[st.Statement]:
    """Yield the statements of every section; remarks and messages are left out."""
    head, mark, tail = text.partition("\n/POS")
    for line, start, code in st.Lines.of(head):
        said = _NUMBERED.sub("", code, count=1).strip().removesuffix(";").strip()
        place = line, start + len(code) - len(code.lstrip()), re.sub(r'"[^"]*"', '""', said)
        if not said or said.startswith("!") or _MESSAGE.fullmatch(said):
            continue
        if _MOTION.fullmatch(said):
            yield TpMove(*place, said[0])
        elif match := re.fullmatch(r"WAIT (\S+)\(sec\)", said):
            yield st.Waiting(*place, match[1])
        else:
            yield st.Pulse(*place) if re.fullmatch(r"DO\[\d+\]=PULSE,.*", said) else st.Statement(*place)
    if mark:
        yield from _positions(tail, len(head) + len(mark), head.count("\n") + 2)


def _positions(text: str, start: int, line: int) -> Iterator[st.Statement]:
    at = 0
    for match in _POSITION.finditer(text):
        yield from _other(text[at : match.start()], start + at, line)
        angles = tuple(float(m) for m in re.findall(_AXIS, match["axes"]))
        yield TpPosition(line, start + match.start(), match[0], int(match["number"]), angles)
        at = match.end()
    yield from _other(text[at:], start + at, line)


def _other(text: str, start: int, line: int) -> Iterator[st.Statement]:
    for said in filter(None, map(str.strip, text.splitlines())):
        yield st.Statement(line, start, said)


class FanucExecution(Execution):
    """Every move says its time and its end; the angles stand with the positions."""

    parse_file = staticmethod(parse)

    def __init__(self, dialect: Dialect, program: Program | None = None) -> None:
        super().__init__(dialect, program)
        self.positions: dict[int, TpPosition] = {}

    def order(self, statements: Sequence[st.Statement]) -> Iterator[st.Statement]:
        """Yield the statements as they stand, after the positions that they name.

        Raises:
            InputError: a position is there twice, or the file does not end with its last section.
        """
        for statement in statements:
            if isinstance(statement, TpPosition) and statement.number in self.positions:
                raise InputError(f"line {statement.line}: P[{statement.number}] is there twice")
            if isinstance(statement, TpPosition):
                self.positions[statement.number] = statement
        if [s.text for s in statements[-1:]] != ["/END"]:
            raise InputError("the program has no /END after its positions")
        yield from statements

    def execute(self, statement: st.Statement) -> bool:
        """Take in a move; motions other than joint moves to a taught position raise InputError."""
        if isinstance(statement, TpPosition):
            return True
        if not isinstance(statement, TpMove):
            return False
        match = _MOVE.fullmatch(statement.text)
        position = self.positions.get(int(match["number"])) if match else None
        if match is None or position is None or (match["unit"] == "%" and self.moves):
            raise InputError(f"line {statement.line}: '{statement.text}' is no joint move of this family")
        blend = None if match["end"] == "FINE" else float(match["end"][3:])
        self.move(position.angles, blend, st.parse_fixed(match["speed"], statement.text))
        return True
