"""FANUC TP as ASCII (.LS): numbered statements under /MN, the joint angles of their positions under /POS."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import planner.programs.languages.statements as st
from planner.common.errors import InputError
from planner.programs.dialect import Dialect
from planner.programs.instructions import Program
from planner.programs.languages.execution import Execution

MAIN, POSITIONS = re.compile(r"^/MN\b", re.MULTILINE), re.compile(r"^/POS\b", re.MULTILINE)
_LINE, TO_SEMICOLON = re.compile(r"[^\r\n]+"), re.compile(r"[^;]+")
_NUMBERED = re.compile(r"^[ \t]*\d*[ \t]*:", re.MULTILINE)
_MOTION = re.compile(r"[JLCAS] P(?:R)?\[.*")
_MOVE = re.compile(rf"J P\[(?P<number>\d+)\] (?P<speed>{st.NUMBER})(?P<unit>sec|%) (?P<end>FINE|CNT\d+)")
_MESSAGE = re.compile(r"MESSAGE\[[^\[\];]*\]")  # shows its text, like a remark
_POSITION = re.compile(
    r'^[ \t]*P\[(?P<number>\d+)(?::(?:\s*"[^"\r\n]*"|[^\]\r\n]*))?\]\s*\{(?P<body>[^{}]*)\}[ \t]*;?', re.MULTILINE
)
_AXIS = rf"(?:J\d|E\d)\s*=\s*({st.NUMBER})\s*deg"
_OWN_POSITION = re.compile(
    r"P\[\d+\]\{\s*GP1:\s*UF : \d+, UT : \d+,\s*"
    rf"(?P<axes>{_AXIS}(?:,\s*{_AXIS})*)\s*\}};"
)


@dataclass(frozen=True)
class TpHead(st.Statement):
    """A line before the instructions."""


@dataclass(frozen=True)
class TpMove(st.MotionStatement):
    """A motion of any kind."""


@dataclass(frozen=True)
class TpPosition(st.Statement):
    """A taught position: its number, and what stands in its braces, with the place of it."""

    number: int
    body: str
    body_start: int


@dataclass(frozen=True)
class TpAmongPositions(st.Statement):
    """A line between the positions that is none."""


def parse(text: str, instruction: re.Pattern[str] = _LINE) -> Iterator[st.Statement]:
    """Yield the statements of every section; remarks and messages are left out, quoted text of the head is blank.

    An ``instruction`` is one line; in programs that others have written it may be several, up to the semicolon.
    """
    lines, positions = st.Lines.of(text), POSITIONS.search(text)
    stop, at = (len(text), len(text)) if positions is None else positions.span()
    main = MAIN.search(text, 0, stop)
    begin = 0 if main is None else main.end()
    for row in _LINE.finditer(text, 0, begin):
        said = row[0].strip().removesuffix(";").strip()
        yield TpHead(lines.number(row.start()), row.start(), re.sub(r'"[^"]*"', '""', said))
    for piece in instruction.finditer(text, begin, stop):
        said = _NUMBERED.sub(" ", piece[0]).strip().removesuffix(";").strip()
        start = piece.start() + len(piece[0]) - len(piece[0].lstrip())
        if said and not _is_remark(said):
            yield _statement(lines.number(start), start, said)
    for match in _POSITION.finditer(text, at):
        yield from _other_statement(text, at, match.start(), lines)
        place = lines.number(match.start("number")), match.start(), match[0].strip()
        yield TpPosition(*place, int(match["number"]), match["body"], match.start("body"))
        at = match.end()
    yield from _other_statement(text, at, len(text), lines)


def _is_remark(said: str) -> bool:
    return (said.startswith("!") and not re.search(r"[\r\n]", said)) or bool(_MESSAGE.fullmatch(said))


def _statement(line: int, start: int, said: str) -> st.Statement:
    if _MOTION.fullmatch(said):
        return TpMove(line, start, said, said[0])
    if match := re.fullmatch(r"WAIT (\S+)\(sec\)", said):
        return st.Waiting(line, start, said, match[1])
    return (st.Pulse if re.fullmatch(r"DO\[\d+\]=PULSE,.*", said) else st.Statement)(line, start, said)


def _other_statement(text: str, start: int, end: int, lines: st.Lines) -> Iterator[st.Statement]:
    for row in re.compile(r"[^\s][^\r\n]*").finditer(text, start, end):
        yield TpAmongPositions(lines.number(row.start()), row.start(), row[0].strip())


class FanucExecution(Execution, family="fanuc"):
    """Every move says its time and its end; the angles stand with the positions."""

    parse_file = staticmethod(parse)

    def __init__(self, dialect: Dialect, program: Program | None = None) -> None:
        super().__init__(dialect, program)
        self.positions: dict[int, list[float]] = {}  # angles [deg]

    def order(self, statements: Sequence[st.Statement]) -> Iterator[st.Statement]:
        """Yield the statements as they stand, after the positions that they name.

        Raises:
            InputError: a position is there twice, or the file does not end with its last section.
        """
        for statement in statements:
            if isinstance(statement, TpPosition) and (match := _OWN_POSITION.fullmatch(statement.text)):
                if statement.number in self.positions:
                    raise InputError(f"line {statement.line}: P[{statement.number}] is there twice")
                self.positions[statement.number] = [float(angle) for angle in re.findall(_AXIS, match["axes"])]
        if [s.text for s in statements[-1:]] != ["/END"]:
            raise InputError("the program has no /END after its positions")
        yield from statements

    def execute(self, statement: st.Statement) -> bool:
        """Process a move; motions other than joint moves to a taught position raise InputError."""
        if isinstance(statement, TpPosition):
            return statement.number in self.positions and _OWN_POSITION.fullmatch(statement.text) is not None
        if not isinstance(statement, TpMove):
            return False
        match = _MOVE.fullmatch(statement.text)
        angles = self.positions.get(int(match["number"])) if match else None
        if match is None or angles is None or (match["unit"] == "%" and self.moves):
            raise InputError(f"line {statement.line}: '{statement.text}' is no joint move of this family")
        blend = None if match["end"] == "FINE" else float(match["end"][3:])
        self.move(angles, blend, st.parse_fixed_point(match["speed"], statement.text))
        return True
