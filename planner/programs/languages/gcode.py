"""G-code whose axis words are the robot's joints (``A1=10.5`` or ``X10.5``), one block a line."""

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from planner.common.errors import InputError
from planner.programs.dialect import Dialect
from planner.programs.instructions import Program
from planner.programs.languages.execution import Execution
from planner.programs.languages.statements import (
    NUMBER,
    Call,
    Lines,
    PlacedNumber,
    Routine,
    RoutineEnd,
    Statement,
    mask_comments,
    parse_fixed_point,
)

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
    comment = (
        r"\([^)\r\n]*(?:\)|(?P<unfinished>))|;[^\r\n]*" if dialect.comment.end else rf"{re.escape(start_mark)}[^\r\n]*"
    )
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


class GcodeExecution(Execution, family="gcode"):
    """The modal state of an interpreter, as far as joint paths need it; its words come from ``[reading]``."""

    def __init__(self, dialect: Dialect, program: Program | None = None) -> None:
        super().__init__(dialect, program)
        reading = dialect.reading
        self.beside = "|".join(filter(None, (reading.motion, reading.exact, reading.with_motion)))
        self.axes = [axis.rstrip("=") for axis in dialect.axes]
        self.blend: float | None = 0.0  # rounding as the machine likes, until a block says otherwise
        self.feed: float | None = None
        self.in_pulse = False
        self.ahead: dict[str, float] = {}  # angles of the axes that go first where the arm comes from anywhere

    def forget(self, stopped: bool) -> None:
        """Forget the feed rate and the rounding that were set."""
        self.feed, self.blend = None, math.nan

    def parse(self, texts: Sequence[str]) -> Iterator[Statement]:
        """Yield the blocks of all files; beginning, end and calls of parts where the dialect has any."""
        blocks = [block for text in texts for block in parse(text, self.dialect)]
        names = {m[1] for b in blocks if (m := re.fullmatch(r"PROC (\w+)", b.text))}
        for block in blocks:
            place = block.line, block.start, block.text
            if self.dialect.files.part is None:
                yield block
            elif match := re.fullmatch(r"PROC (\w+)", block.text):
                yield Routine(*place, match[1])
            elif block.text == "M17":
                yield RoutineEnd(*place)
            else:
                yield Call(*place, block.text) if block.text in names else block

    def order(self, statements: Sequence[Statement]) -> Iterator[Statement]:
        """Yield the blocks one after the other, to the end of the program, those of a part where it is called.

        Raises:
            InputError: something stands behind the end, or there is none; a part calls another.
        """
        bodies: dict[str, list[Statement]] = {}
        main: list[Statement] = []
        here = main
        for statement in statements:
            match statement:
                case Routine(name=name):
                    here = bodies.setdefault(name, [])
                case RoutineEnd():
                    here = main
                case Call() if here is not main:
                    raise InputError(f"line {statement.line}: the part {statement.text} is called by another")
                case _:
                    here.append(statement)
        called = [c.name for c in main if isinstance(c, Call)]
        if here is not main or sorted(called) != sorted(bodies):
            raise InputError("a part has no end (M17), or is not called once")
        yield from self._to_the_end(b for s in main for b in (bodies[s.name] if isinstance(s, Call) else (s,)))

    def _to_the_end(self, blocks: Iterable[Statement]) -> Iterator[Statement]:
        ended = False
        for block in blocks:
            if ended:
                raise InputError(f"line {block.line}: '{block.text}' stands behind the end of the program")
            ended = re.fullmatch("M0?2|M30", block.text) is not None
            yield block
        if not ended:
            raise InputError("the program has no end (M2 or M30)")

    def execute(self, statement: Statement) -> bool:
        """Process one block and return whether it decides how the robot moves.

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
                self.dwell(parse_fixed_point(dwell["seconds"], f"line {statement.line}"))
        elif isinstance(statement, Block) and re.search(rf"(^|\s){patterns.motion}(\s|$)", said):
            self._move(statement)
        elif patterns.exact and re.fullmatch(patterns.exact, said):
            self.blend = None
        elif patterns.blended and (rounding := re.fullmatch(patterns.blended, said)):
            self.blend = parse_fixed_point(rounding["value"], f"line {statement.line}")
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
                self.feed = parse_fixed_point(number.text, where)
            elif name in self.axes and name not in found:
                found[name] = parse_fixed_point(number.text, where)
            elif name != "G" or not re.fullmatch(self.beside, f"G{number.text}"):
                raise InputError(f"{where}: the word '{name}{number.text}' is unknown or stands twice")
        if self._goes_ahead(found, where):
            return
        if list(found) != self.axes[: len(found)]:
            raise InputError(f"{where}: axes {list(found)} are not the first of {self.axes}")
        if self.feed is None:
            raise InputError(f"{where}: the first move has no feed")
        angles = list(found.values())
        self.move(angles, None if here else self.blend, max(self.feed, self._least_feed(angles)))

    def _least_feed(self, angles: list[float]) -> float:
        """Return the inverse time [1/min] by which the controller drives a move to ``angles`` [deg] at least.

        LinuxCNC's interpreter takes no feed along X Y Z below 0.1 (``inverse_time_rate_straight``), and A B C go along.
        """
        if not self.dialect.speed.least or not self.moves or len(self.moves[-1].angles_deg) != len(angles):
            return 0.0
        way = np.subtract(angles, self.moves[-1].angles_deg)
        first = np.isin(self.axes[: len(angles)], self.dialect.speed.approach_first)
        others = float(np.linalg.norm(way[~first]))
        return self.dialect.speed.least / others if others > 0.0 and way[first].any() else 0.0

    def _goes_ahead(self, found: dict[str, float], where: str) -> bool:
        """Take in a block of the first move, and return whether it drives but the axes that go first.

        Raises:
            InputError: they do not go first, without the others, or the next block leads them elsewhere.
        """
        first = [a for a in self.axes if a in self.dialect.speed.approach_first]
        if not first or self.moves or self.entries:
            return False
        if found and set(found) <= set(first) and not self.ahead:
            self.ahead = found
            return True
        if self.ahead != {a: angle for a, angle in found.items() if a in first}:
            raise InputError(
                f"{where}: the first move, from wherever the arm stands, must drive {' '.join(first)} alone before: "
                "while another axis moves F is not their speed, and they may be as fast as they can; export it anew"
            )
        return False
