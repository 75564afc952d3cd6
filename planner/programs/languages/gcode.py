"""G-code whose axis words are the robot's joints (``A1=10.5`` or ``X10.5``), one block a line."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from planner.common.errors import InputError
from planner.programs.dialect import Dialect
from planner.programs.instructions import Program
from planner.programs.languages.execution import Execution
from planner.programs.languages.statements import PlacedNumber, Statement, parse_fixed
from planner.programs.languages.text import NUMBER, Lines, mask_comments

_WORD = re.compile(rf"([A-Z]+\d*=|[A-Z])\s*({NUMBER})")
_HEAD = re.compile(r"\s*(?P<optional>/\d*\s*)?(?:N\d+\s*)?")


@dataclass(frozen=True)
class Block(Statement):
    """One block in capitals; ``words`` is None where it is more than a plain row of them.

    ``optional``: the operator can have it left out.
    """

    words: tuple[tuple[str, PlacedNumber], ...] | None
    optional: bool

    @property
    def codes(self) -> list[str]:
        """The G words, such as ``G1`` and ``G61.1``."""
        return ["G" + str(number.value).removesuffix(".0") for name, number in self.words or () if name == "G"]


def parse(text: str, dialect: Dialect) -> Iterator[Block]:
    """Yield the blocks of a program, without their numbers."""
    start_mark = dialect.comment.start.strip()
    comment = r"\([^)\r\n]*\)|;[^\r\n]*" if dialect.comment.end else rf"{re.escape(start_mark)}[^\r\n]*"
    for line, start, code in Lines.of(mask_comments(text, comment)):
        head = _HEAD.match(code.upper())
        assert head is not None
        code = code.upper()[head.end() :]
        if code.strip() and not code.startswith("%"):
            at = start + head.end()
            yield Block(line, at, code.strip(), _words(code, at), head["optional"] is not None)


def _words(code: str, start: int) -> tuple[tuple[str, PlacedNumber], ...] | None:
    found, at = [], 0
    for match in _WORD.finditer(code):
        if code[at : match.start()].strip():
            return None
        number = PlacedNumber(float(match[2]), match[2], start + match.start(2))
        found.append((match[1].rstrip("="), number))
        at = match.end()
    return None if code[at:].strip() else tuple(found)


class GcodeExecution(Execution):
    """The modal state of an interpreter, as far as joint paths need it; its words come from ``[reading]``."""

    def __init__(self, dialect: Dialect, program: Program | None = None) -> None:
        super().__init__(dialect, program)
        reading = dialect.reading
        self.beside = "|".join(filter(None, (reading.motion, reading.exact, reading.with_motion)))
        self.axes = [axis.rstrip("=") for axis in dialect.axes]
        self.blend: float | None = 0.0  # rounding as the machine likes, until a block says otherwise
        self.feed: float | None = None
        self.in_pulse = False

    def forget(self, stopped: bool) -> None:
        """Forget feed and rounding."""
        self.feed, self.blend = None, math.nan

    def parse(self, texts: Sequence[str]) -> Iterator[Statement]:
        """Yield the blocks of the one file."""
        return parse(texts[0], self.dialect)

    def order(self, statements: Sequence[Statement]) -> Iterator[Statement]:
        """Yield the blocks one after the other, to the end of the program."""
        ended = False
        for block in statements:
            if ended:
                raise InputError(f"line {block.line}: '{block.text}' stands behind the end of the program")
            ended = re.fullmatch("M0?2|M30", block.text) is not None
            yield block
        if not ended:
            raise InputError("the program has no end (M2 or M30)")

    def execute(self, statement: Statement) -> bool:
        """Take in one block and return whether it decides how the robot moves.

        Raises:
            InputError: a motion that is not understood.
        """
        patterns, said = self.dialect.reading, statement.text
        if re.match(patterns.sync, said):
            self.syncs += 1
            self.in_pulse = bool(patterns.pulse_end)
            return False  # whether it is the right output, the list of known statements tells
        if patterns.pulse_end and re.match(patterns.pulse_end, said):
            self.in_pulse = False
            return False
        if dwell := re.fullmatch(patterns.dwell, said):
            if not self.in_pulse:
                self.dwell(parse_fixed(dwell["seconds"], f"line {statement.line}"))
        elif isinstance(statement, Block) and re.search(rf"(^|\s){patterns.motion}(\s|$)", said):
            self._move(statement)
        elif patterns.exact and re.fullmatch(patterns.exact, said):
            self.blend = None
        elif patterns.blended and (rounding := re.fullmatch(patterns.blended, said)):
            self.blend = parse_fixed(rounding["value"], f"line {statement.line}")
        else:
            return re.fullmatch("M0?2|M30", said) is not None
        return True

    def _move(self, block: Block) -> None:
        where, exact = f"line {block.line}", self.dialect.reading.exact
        if block.words is None or block.optional:
            raise InputError(f"{where}: '{block.text}' is no joint move of this family")
        self.in_pulse = False  # a pulse given in passing ends by itself
        here = bool(exact and re.search(rf"(^|\s)({exact})(\s|$)", block.text))
        found: dict[str, float] = {}
        for name, number in block.words:
            if name == "F":
                self.feed = parse_fixed(number.text, where)
            elif name in self.axes and name not in found:
                found[name] = parse_fixed(number.text, where)
            elif name != "G" or not re.fullmatch(self.beside, f"G{number.text}"):
                raise InputError(f"{where}: the word '{name}{number.text}' is unknown or stands twice")
        if list(found) != self.axes[: len(found)]:
            raise InputError(f"{where}: axes {list(found)} are not the first of {self.axes}")
        if self.feed is None:
            raise InputError(f"{where}: the first move has no feed")
        self.move(list(found.values()), None if here else self.blend, self.feed)
