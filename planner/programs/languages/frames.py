"""Frames of a servo arm (CSV): goals of every joint at an even rate; an event says where a leg or a stay ends."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import planner.programs.languages.statements as st
from planner.common.errors import InputError
from planner.programs.languages.execution import Execution

_HEAD = re.compile(r"timestamp,((?:[A-Za-z][\w/-]*\.pos,)+)event")
_EVENT = re.compile(r"|move|via|dwell \d+\.\d+")


@dataclass(frozen=True)
class FramesHead(st.Statement):
    """The names of the columns, with which every file begins."""


@dataclass(frozen=True)
class Frame(st.MotionStatement):
    """The goals of all joints [deg], when they are given [s], and what ends there."""

    angles: tuple[float, ...]
    time: float
    event: str


def parse(text: str) -> Iterator[st.Statement]:
    """Yield the rows of one file."""
    for line, start, code in st.Lines.of(text):
        place = line, start, code.strip()
        if not place[2] or place[2].startswith("#"):
            continue
        time, *angles = place[2].split(",")
        event = angles.pop() if angles else ""
        if _HEAD.fullmatch(place[2]):
            yield FramesHead(*place)
        elif angles and _EVENT.fullmatch(event):
            where = f"line {line}"
            goals = tuple(st.parse_fixed(a, where) for a in angles)
            yield Frame(*place, "frame", goals, st.parse_fixed(time, where), event)
        else:
            yield st.Statement(*place)


class FramesExecution(Execution):
    """Legs and stays from the frames between their ends."""

    parse_file = staticmethod(parse)

    def order(self, statements: Sequence[st.Statement]) -> Iterator[st.Statement]:
        """Yield the rows as they are played.

        Raises:
            InputError: a file names other joints, or the frames do not come at the rate.
        """
        heads = {s.text for s in statements if isinstance(s, FramesHead)}
        names = () if self.program is None else self.program.joint_names or self.dialect.axes[: self.program.n_joints]
        wanted = {f"timestamp,{''.join(f'{n}.pos,' for n in names)}event"} if names else set(sorted(heads)[:1])
        if not heads or heads != wanted:
            raise InputError(f"the files have the columns {sorted(heads) or 'none'}, not {sorted(wanted)}")
        self.rate = float(self.dialect.speed.word)
        self.here: tuple[float, ...] | None = None
        self.waiting: list[Frame] = []
        number = 0
        for statement in statements:
            number = 0 if isinstance(statement, FramesHead) else number + isinstance(statement, Frame)
            if isinstance(statement, Frame) and abs(statement.time - number / self.rate) > 1e-3:
                raise InputError(f"line {statement.line}: frame {number} is at {statement.time} s")
            yield statement
        if self.waiting:
            raise InputError(f"line {self.waiting[0].line}: the last frames end neither a leg nor a stay")

    def execute(self, statement: st.Statement) -> bool:
        """Take in a frame."""
        if not isinstance(statement, Frame):
            return isinstance(statement, FramesHead)
        self.waiting.append(statement)
        if statement.event.startswith("dwell"):
            self._stay(statement, float(statement.event.removeprefix("dwell ")))
        elif statement.event:
            self._leg(statement)
        return True

    def _stay(self, end: Frame, seconds: float) -> None:
        frames, self.waiting = self.waiting, []
        if any(f.angles != self.here for f in frames) or not 0.0 <= len(frames) / self.rate - seconds < 1.0 / self.rate:
            raise InputError(f"line {end.line}: '{end.text}' ends no stay of {seconds} s at one place")
        self.dwell(seconds)

    def _leg(self, end: Frame) -> None:
        """A leg is a straight line at even speed from where the last one ended."""
        frames, self.waiting = self.waiting, []
        begin, n = self.here or end.angles, len(frames)
        slack = 1.01 * 10.0**-self.dialect.decimals
        for k, frame in enumerate(frames, start=1):
            straight = [a + (b - a) * k / n for a, b in zip(begin, end.angles, strict=True)]
            if max(abs(g - s) for g, s in zip(frame.angles, straight, strict=True)) > slack:
                raise InputError(f"line {frame.line}: '{frame.text}' leaves the straight line of its leg")
        self.here = end.angles
        self.move(list(end.angles), None if end.event == "move" else 0.0, n / self.rate)
