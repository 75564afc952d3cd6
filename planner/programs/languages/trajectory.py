"""ROS 2 JointTrajectory as YAML: a file a stretch, one point a line, radians and the time from the file's start."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import planner.programs.languages.statements as st
from planner.common.errors import InputError
from planner.programs.languages.execution import Execution

CUBIC = 1.5
"""Peak over mean speed of the cubic that a controller joins two points at rest with."""
_ROW = rf"\[({st.NUMBER}(?:, {st.NUMBER})*)\]"
_ZEROS = r"\[0\.0(?:, 0\.0)*\]"
_POINT = re.compile(
    rf"- \{{positions: {_ROW}(?P<rest>, velocities: {_ZEROS})?(?P<dwell>, accelerations: {_ZEROS})?"
    r", time_from_start: \{sec: (?P<sec>\d+), nanosec: (?P<nanosec>\d{1,9})\}\}"
)


@dataclass(frozen=True)
class FileBegin(st.Statement):
    """The names of the joints, with which every file begins."""


@dataclass(frozen=True)
class TrajectoryPoint(st.MotionStatement):
    """Angles [deg], time from the start of its file [s], whether the arm is at rest, and whether it only stays."""

    angles: tuple[float, ...]
    time: float
    rest: bool
    dwell: bool


def parse(text: str) -> Iterator[st.Statement]:
    """Yield the lines of one file."""
    for line, start, code in st.Lines.of(text):
        said = code.strip()
        place = line, start, said
        if not said or said.startswith("#"):
            continue
        if match := _POINT.fullmatch(said):
            angles = tuple(math.degrees(float(n.value)) for n in st.placed_numbers(match[1], 0, st.NUMBER))
            time = int(match["sec"]) + 1e-9 * int(match["nanosec"])
            yield TrajectoryPoint(*place, "point", angles, time, match["rest"] is not None, match["dwell"] is not None)
        elif said.startswith("joint_names:"):
            yield FileBegin(*place)
        else:
            yield st.Statement(*place)


class TrajectoryExecution(Execution):
    """The points of all files, one file after the other."""

    parse_file = staticmethod(parse)

    def order(self, statements: Sequence[st.Statement]) -> Iterator[st.Statement]:
        """Yield the points as they are driven.

        Raises:
            InputError: a file names other joints, its times do not increase, or a stay is at another place.
        """
        self._check_names([s.text for s in statements if isinstance(s, FileBegin)])
        last: TrajectoryPoint | None = None  # a file may begin with a stay where the one before ended
        since = 0.0
        for each in statements:
            if isinstance(each, FileBegin):
                since = 0.0
            elif isinstance(each, TrajectoryPoint):
                self._check_point(each, since, moved=last is None or last.angles != each.angles)
                last, since = each, each.time
                yield each

    def execute(self, statement: st.Statement) -> bool:
        """Take in a point."""
        if not isinstance(statement, TrajectoryPoint):
            return isinstance(statement, FileBegin)
        seconds = self.seconds[id(statement)]
        if statement.dwell:
            self.dwell(seconds)
            return True
        self.move(list(statement.angles), None if statement.rest else 0.0, seconds / (CUBIC if statement.rest else 1.0))
        return True

    seconds: dict[int, float]

    def _check_names(self, named: list[str]) -> None:
        self.seconds = {}
        wanted = self.program.joint_names if self.program is not None else ()
        if self.program is not None and not wanted:
            wanted = self.dialect.axes[: self.program.n_joints]
        allowed = {f"joint_names: [{', '.join(wanted)}]"} if wanted else set(named[:1])
        if not named or set(named) != allowed:
            raise InputError(f"the files name the joints {sorted(set(named)) or 'not at all'}, not {sorted(allowed)}")

    def _check_point(self, point: TrajectoryPoint, since: float, moved: bool) -> None:
        if not since < point.time or (point.dwell and moved):
            raise InputError(f"line {point.line}: '{point.text}' goes back in time, or stays elsewhere")
        self.seconds[id(point)] = point.time - since
