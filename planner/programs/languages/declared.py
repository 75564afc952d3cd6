"""Languages whose moves drive to positions that a file declares: the parser says what stands there, the rest follows.

A language is then one module: a parser that yields the statements below, and a subclass of :class:`DeclaredExecution`.
Programs of the planner are read back by that class, programs of others are corrected by the same statements
(:mod:`planner.compensation.formats.declared`).
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import planner.programs.languages.statements as st
from planner.common.errors import InputError
from planner.programs.dialect import Dialect
from planner.programs.instructions import Program
from planner.programs.languages.execution import Execution

NO_ROOM = r"(?!)"


@dataclass(frozen=True)
class ArmShape:
    """The way in which the arm reaches a pose, as a language says it; what is None is as at the target before.

    Attributes:
        rear: the wrist's centre is behind axis 1.
        elbow_up: the elbow lies above the line from shoulder to wrist, seen with the arm in front.
        third_over: joint 3 counts more than where the arm is stretched; a language says this or ``elbow_up``.
        fifth_negative: joint 5 counts less than 0.
        within: ranges [deg], each a joint from 0 and pairs of ends, of which one must hold the joint's angle.
        unknown: words of which no source says what they mean; a straight move to the pose keeps the shape all the same.
    """

    rear: bool | None = None
    elbow_up: bool | None = None
    third_over: bool | None = None
    fifth_negative: bool | None = None
    within: tuple[tuple[int, tuple[tuple[float, float], ...]], ...] = ()
    unknown: str = ""


@dataclass(frozen=True)
class Position(st.Statement):
    """A position with a name.

    Attributes:
        name: as moves call it.
        joints: its angles [deg], or pulses, in the order of the axes; none of a pose.
        pose: place [mm] and three angles [deg] of the tool; none of joint angles.
        shape: of the arm at a pose; None where it stays as it is at the target before.
        tool, base: the frames that stand with the position, as in :class:`FrameChange`; None where it says none.
        why_not: why the numbers are not certain.
    """

    name: str
    joints: tuple[st.PlacedNumber, ...] = ()
    pose: tuple[st.PlacedNumber, ...] = ()
    shape: ArmShape | None = None
    tool: str | None = None
    base: str | None = None
    why_not: str = ""


@dataclass(frozen=True)
class Frame(st.Statement):
    """A tool in the flange, or a base in the robot's: six numbers as of a pose, or why they are not known."""

    name: str
    numbers: tuple[st.PlacedNumber, ...] = ()
    why_not: str = ""


@dataclass(frozen=True)
class FrameChange(st.Statement):
    """Which tool or base holds from here on; None: as before, an empty name: the flange, the robot's own base."""

    tool: str | None = None
    base: str | None = None


@dataclass(frozen=True)
class Words(st.Statement):
    """Speed and rounding of moves to come, by the name of what holds them; None leaves what was said before."""

    name: str
    speed: float | None = None
    rounded: bool | None = None
    distance: float | None = None


@dataclass(frozen=True)
class Move(st.MotionStatement):
    """A motion to one position, or to several of which each is a target of its own.

    Attributes:
        targets: names of positions.
        inline: a position that stands in the move itself.
        straight: a line or a circle, in which the arm keeps its shape.
        speed: number of the speed word; None where ``words`` or nobody says it.
        blend: how far the corner is rounded; None: an exact stop.
        words: name of the :class:`Words` that say speed and rounding.
        tool: of the move; None where another statement or the position says it.
        why_not: why the targets are not certain; empty where they are.
    """

    targets: tuple[str, ...] = ()
    inline: Position | None = None
    straight: bool = False
    speed: float | None = None
    blend: float | None = None
    words: str = ""
    tool: str | None = None
    why_not: str = ""


class DeclaredExecution(Execution):
    """Runs the moves of a program of the planner: joint moves to positions in joint angles.

    Attributes:
        rotation: the axes of the three angles of a pose, as scipy's ``Rotation.from_euler`` takes them.
        shifts: a statement that begins so moves targets in a way that is not known here.
        name_letter: a letter that makes a name another one, where it stands behind it.
        any_case: small letters and capitals make the same name; the parser yields small ones.
        stop: the statement that waits for the arm to stand, where the program runs ahead of it; a move before any other
            statement is then no exact stop.
    """

    rotation: ClassVar[str]
    shifts: ClassVar[str] = NO_ROOM
    name_letter: ClassVar[str] = r"[\w.]"
    any_case: ClassVar[bool] = False
    stop: ClassVar[str] = ""

    def __init__(self, dialect: Dialect, program: Program | None = None) -> None:
        super().__init__(dialect, program)
        self.positions: dict[str, Position] = {}
        self.words: dict[str, Words] = {}

    def forget(self, stopped: bool) -> None:
        """Forget speeds and roundings that a later start may have left unsaid."""
        del stopped
        self.words = {}

    def order(self, statements: Sequence[st.Statement]) -> Iterator[st.Statement]:
        """Yield the positions, and then the statements in the order in which they run, from the first routine on.

        Raises:
            InputError: a position is there twice.
        """
        positions = [s for s in statements if isinstance(s, Position)]
        for statement in positions:
            if statement.name in self.positions:
                raise InputError(f"line {statement.line}: {statement.name} is there twice")
            self.positions[statement.name] = statement
        yield from positions
        rest = [s for s in statements if not isinstance(s, Position)]
        yield from st.run_order(rest) if any(isinstance(s, st.Routine) for s in rest) else rest

    def execute(self, statement: st.Statement) -> bool:
        """Process a move; others than joint moves to joint angles raise InputError."""
        match statement:
            case Position():
                return bool(statement.joints) and not statement.why_not
            case Words():
                old = self.words.get(statement.name, statement)
                said = {k: v for k in ("speed", "rounded", "distance") if (v := getattr(statement, k)) is not None}
                self.words[statement.name] = replace(old, **said)
            case Move():
                self._drive(statement)
            case st.MotionStatement():
                raise self._refusal(statement)
            case _ if self.stop and statement.text == self.stop:
                self.moves[-1:] = [replace(move, blend=None) for move in self.moves[-1:]]
            case _:
                return False
        return True

    def rounding(self, move: Move) -> float | None:
        """Return how far the corner of a move is rounded, None where it is an exact stop."""
        words = self.words.get(move.words)
        return move.blend if words is None else words.distance if words.rounded else None

    def _drive(self, move: Move) -> None:
        position = move.inline or self.positions.get(move.targets[0] if len(move.targets) == 1 else "")
        words = self.words.get(move.words)
        speed = move.speed if move.speed is not None or words is None else words.speed
        sure = position is not None and position.joints and not position.why_not
        if position is None or not sure or move.straight or move.why_not or speed is None:
            raise self._refusal(move)
        counts = [st.parse_fixed_point(n.text, position.text) for n in position.joints]
        per_deg = self.pulses_per_deg if self.dialect.pulses else (1.0,) * len(counts)
        if len(per_deg) != len(counts):
            raise InputError(f"line {position.line}: {position.name} has {len(counts)} axes, known are {len(per_deg)}")
        blend = self.rounding(move)
        angles = [count / k for count, k in zip(counts, per_deg, strict=True)]
        self.move(angles, 0.0 if blend is None and self.stop else blend, speed)

    def _refusal(self, move: st.Statement) -> InputError:
        return InputError(f"line {move.line}: '{move.text}' is no joint move of this family")


def numbers_in(text: str, start: int, count: int) -> tuple[st.PlacedNumber, ...]:
    """Return the plain numbers in a text that begins at ``start``; none where there are not ``count`` and no more.

    Commas and blanks stand between them.
    """
    cells = list(re.finditer(r"[^\s,]+", text))
    if len(cells) != count or not all(re.fullmatch(st.NUMBER, c[0]) for c in cells):
        return ()
    return tuple(st.PlacedNumber(float(c[0]), c[0], start + c.start()) for c in cells)
