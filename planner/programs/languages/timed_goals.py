"""Goals of all joints with their times, a file a stretch: ROS 2 JointTrajectory (YAML), frames of a servo arm (CSV).

A trajectory has a point a line, in radians. Frames come at an even rate, and an event says where a leg or a stay ends.
"""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

import planner.programs.languages.statements as st
from planner.common.errors import InputError
from planner.common.units import Array
from planner.programs.languages.execution import Execution

_ROW = rf"\[({st.NUMBER}(?:, {st.NUMBER})*)\]"
_ZEROS = r"\[0\.0(?:, 0\.0)*\]"
_POINT = re.compile(
    rf"- \{{positions: {_ROW}, velocities: (?P<velocities>\[{st.NUMBER}(?:, {st.NUMBER})*\])"
    rf"(?P<dwell>, accelerations: {_ZEROS})?"
    r", time_from_start: \{sec: (?P<sec>\d+), nanosec: (?P<nanosec>\d{1,9})\}\}"
)
_COLUMNS = re.compile(r"timestamp,((?:[A-Za-z][\w/-]*\.pos,)+)event")
_EVENT = re.compile(r"|move|via|dwell \d+\.\d+")


@dataclass(frozen=True)
class FileHead(st.Statement):
    """The names of the joints, with which every file begins."""


@dataclass(frozen=True)
class TimedGoal(st.MotionStatement):
    """Angles [deg], their time from the start of the file [s], the event there (the end of a move, via or dwell), and
    the velocities [deg/s] where they are said."""

    angles: tuple[float, ...]
    time: float
    event: str
    velocities: tuple[float, ...] = ()


class TimedExecution(Execution):
    """Goals of all files, one file after the other; every file names the same joints."""

    def check_heads(self, statements: Sequence[st.Statement], what: str, own: str) -> None:
        """Hold the heads of all files against that of the program's ``own`` joints, or against one another.

        Raises:
            InputError: a file names other joints, or none does.
        """
        heads = {s.text for s in statements if isinstance(s, FileHead)}
        wanted = {own} if self.joint_names else set(sorted(heads)[:1])
        if not heads or heads != wanted:
            raise InputError(f"the files {what} {sorted(heads) or 'none'}, not {sorted(wanted)}")

    def _begin_file(self, statement: st.Statement) -> bool:
        """Note that a person begins the next file, and return whether the statement is the head of one."""
        head = isinstance(statement, FileHead)
        if head and self.moves:
            self.stops.append(("pause", len(self.moves)))
        return head


def parse_trajectory(text: str) -> Iterator[st.Statement]:
    """Yield the lines of one file."""
    for line, start, code in st.Lines.of(text):
        place = line, start, code.strip()
        if not place[2] or place[2].startswith("#"):
            continue
        if match := _POINT.fullmatch(place[2]):
            angles = tuple(math.degrees(float(n.value)) for n in st.placed_numbers(match[1], 0, st.NUMBER))
            time = int(match["sec"]) + 1e-9 * int(match["nanosec"])
            velocities = tuple(math.degrees(n.value) for n in st.placed_numbers(match["velocities"], 0, st.NUMBER))
            event = "dwell" if match["dwell"] is not None else "via" if any(velocities) else "move"
            known = len(velocities) == len(angles) and not (event == "dwell" and any(velocities))
            goal = TimedGoal(*place, "point", angles, time, event, velocities)
            yield goal if known else st.Statement(*place)
        else:
            yield (FileHead if place[2].startswith("joint_names:") else st.Statement)(*place)


class TrajectoryExecution(TimedExecution, family="trajectory"):
    """A leg or a stay ends at every point."""

    parse_file = staticmethod(parse_trajectory)
    seconds: dict[int, float]
    """Since the point before, by the identity of the statement [s]."""
    before: TimedGoal | None = None

    def order(self, statements: Sequence[st.Statement]) -> Iterator[st.Statement]:
        """Yield the points as they are driven.

        Raises:
            InputError: a file names other joints, its times do not increase, or a stay is at another place.
        """
        self.check_heads(statements, "name the joints", f"joint_names: [{', '.join(self.joint_names)}]")
        self.seconds = {}
        goals, taken = list[TimedGoal](), list[float]()
        last: TimedGoal | None = None  # a file may begin with a stay where the one before ended
        since = 0.0
        for each in statements:
            if isinstance(each, FileHead):
                since = 0.0
                yield each
            elif isinstance(each, TimedGoal):
                moved = last is None or last.angles != each.angles
                if not since < each.time or (each.event == "dwell" and moved):
                    raise InputError(f"line {each.line}: '{each.text}' goes back in time, or stays elsewhere")
                self.seconds[id(each)] = each.time - since
                goals.append(self._in_millimetres(each))
                taken.append(each.time - since)
                last, since = each, each.time
                yield each
        self.acceleration = _of_cubics(goals, np.array(taken[1:]))

    def _in_millimetres(self, goal: TimedGoal) -> TimedGoal:
        """Return a goal whose axes that slide, in metres as they are printed, are in millimetres."""
        slides = [self.program is not None and self.program.slides(k) for k in range(len(goal.angles))]
        if not any(slides):
            return goal
        places, speeds = (
            tuple(1e3 * math.radians(v) if s else v for v, s in zip(values, slides, strict=True))
            for values in (goal.angles, goal.velocities)
        )
        return replace(goal, angles=places, velocities=speeds)

    def execute(self, statement: st.Statement) -> bool:
        """Process a point."""
        if not isinstance(statement, TimedGoal):
            return self._begin_file(statement)
        seconds, goal = self.seconds[id(statement)], self._in_millimetres(statement)
        before, self.before = self.before, goal
        if goal.event == "dwell":
            self.dwell(seconds)
        elif goal.event == "move" and (before is None or before.event != "via"):
            # 1.5: peak over mean speed of the cubic that a controller joins two points at rest with
            self.move(goal.angles, None, seconds / 1.5)
        else:
            blend = None if goal.event == "move" else 0.0
            self.move(goal.angles, blend, seconds, peak=_cubic_peak(before, goal, seconds))
        return True


def _of_cubics(goals: list[TimedGoal], seconds: Array) -> tuple[float, ...]:
    """Return each joint's largest acceleration on the cubics between goals: that is at an end of one [deg/s²]."""
    if len(goals) < 2 or len({len(g.angles) for g in goals}) > 1:
        return ()
    q, v, h = np.array([g.angles for g in goals]), np.array([g.velocities for g in goals]), seconds[:, None]
    moved = np.diff(q, axis=0) / h
    ends = np.abs([6.0 * moved - 4.0 * v[:-1] - 2.0 * v[1:], 4.0 * v[1:] + 2.0 * v[:-1] - 6.0 * moved]).max(axis=0) / h
    # 1e-7: [rad] of a printed angle, both its neighbours and its velocity taken together
    rounding = 6.0 * math.degrees(1e-7) * (1.0 / h**2 + 1.0 / h)
    return tuple(np.maximum(ends - rounding, 0.0).max(axis=0).tolist())


def _of_frames(files: list[list[TimedGoal]], rate: float, printed: float) -> tuple[float, ...]:
    """Return each joint's largest acceleration from frame to frame, at rest where a file ends [deg/s²]."""
    if len({len(g.angles) for frames in files for g in frames}) != 1:
        return ()
    largest, here = np.zeros(len(files[0][0].angles)), files[0][0].angles
    for frames in files:
        q = np.array([here, here, *(g.angles for g in frames), frames[-1].angles])
        here = frames[-1].angles
        largest = np.maximum(largest, np.abs(np.diff(q, n=2, axis=0)).max(axis=0))
    return tuple((np.maximum(largest - 2.0 * printed, 0.0) * rate**2).tolist())


def _cubic_peak(before: TimedGoal | None, goal: TimedGoal, seconds: float) -> float:
    """Return the largest over the mean speed of the cubic between two points, of the joint that moves furthest."""
    count = 32  # parts of a leg that is passed, at which its speed is looked at
    if before is None:
        raise InputError(f"line {goal.line}: '{goal.text}' passes the first point, where nobody knows the path to it")
    moved = [b - a for a, b in zip(before.angles, goal.angles, strict=True)]
    j = max(range(len(moved)), key=lambda k: abs(moved[k]))
    if moved[j] == 0.0:
        return 1.0
    begin, end = (velocities[j] * seconds / moved[j] for velocities in (before.velocities, goal.velocities))
    parts = (k / count for k in range(count + 1))
    speeds = ((1 - 4 * u + 3 * u * u) * begin + 6 * u * (1 - u) + (3 * u * u - 2 * u) * end for u in parts)
    return max(abs(speed) for speed in speeds)


def parse_frames(text: str) -> Iterator[st.Statement]:
    """Yield the rows of one file."""
    for line, start, code in st.Lines.of(text):
        place = line, start, code.strip()
        if not place[2] or place[2].startswith("#"):
            continue
        time, *angles = place[2].split(",")
        event = angles.pop() if angles else ""
        if _COLUMNS.fullmatch(place[2]):
            yield FileHead(*place)
        elif angles and _EVENT.fullmatch(event):
            where = f"line {line}"
            goals = tuple(st.parse_fixed_point(a, where) for a in angles)
            yield TimedGoal(*place, "frame", goals, st.parse_fixed_point(time, where), event)
        else:
            yield st.Statement(*place)


class FramesExecution(TimedExecution, family="frames"):
    """Legs and stays from the frames between their ends."""

    parse_file = staticmethod(parse_frames)

    def order(self, statements: Sequence[st.Statement]) -> Iterator[st.Statement]:
        """Yield the rows as they are played.

        Raises:
            InputError: a file names other joints, or the frames do not come at the rate.
        """
        columns = "".join(f"{name}.pos," for name in self.joint_names)
        self.check_heads(statements, "have the columns", f"timestamp,{columns}event")
        self.rate = float(self.dialect.speed.word)
        self.here: tuple[float, ...] | None = None
        self.waiting: list[TimedGoal] = []
        number = 0
        files: list[list[TimedGoal]] = []
        for statement in statements:
            if isinstance(statement, FileHead):
                files.append([])
            elif isinstance(statement, TimedGoal) and files:
                files[-1].append(statement)
            number = 0 if isinstance(statement, FileHead) else number + isinstance(statement, TimedGoal)
            if isinstance(statement, TimedGoal) and abs(statement.time - number / self.rate) > 1e-3:
                raise InputError(f"line {statement.line}: frame {number} is at {statement.time} s")
            yield statement
        if self.waiting:
            raise InputError(f"line {self.waiting[0].line}: the last frames end neither a segment nor a stay")
        driven = [frames for frames in files if frames]
        self.acceleration = _of_frames(driven, self.rate, 10.0**-self.dialect.decimals) if driven else ()

    def execute(self, statement: st.Statement) -> bool:
        """Process a frame."""
        if not isinstance(statement, TimedGoal):
            return self._begin_file(statement)
        self.waiting.append(statement)
        if statement.event:
            frames, self.waiting = self.waiting, []
            if statement.event.startswith("dwell"):
                self._stay(frames, float(statement.event.removeprefix("dwell ")))
            else:
                self._leg(frames)
        return True

    def _stay(self, frames: list[TimedGoal], seconds: float) -> None:
        if any(f.angles != self.here for f in frames) or not 0.0 <= len(frames) / self.rate - seconds < 1.0 / self.rate:
            raise InputError(f"line {frames[-1].line}: '{frames[-1].text}' ends no stay of {seconds} s at one place")
        self.dwell(seconds)

    def _leg(self, frames: list[TimedGoal]) -> None:
        """A leg follows the straight line from where the last one ended, in the time that its frames give it."""
        end, n = frames[-1], len(frames)
        begin = self.here or end.angles
        moved = [b - a for a, b in zip(begin, end.angles, strict=True)]
        j = max(range(len(moved)), key=lambda k: abs(moved[k]))
        printed = 1.01 * 10.0**-self.dialect.decimals
        passed = end.event == "via" or (bool(self.moves) and not self._stopped)
        # 0.35: of a short step: the cubic between two points that are passed leaves the straight line by no more
        bent = 0.35 * abs(moved[j]) if passed else 0.0
        last, quickest = begin[j], 0.0
        for frame in frames:
            share = (frame.angles[j] - begin[j]) / moved[j] if moved[j] else 0.0
            straight = [a + m * share for a, m in zip(begin, moved, strict=True)]
            off = max(abs(g - s) for g, s in zip(frame.angles, straight, strict=True))
            back = (last - frame.angles[j]) * math.copysign(1.0, moved[j])
            if off > 2.0 * printed + bent or max(back, share - 1.0) > printed + bent:
                raise InputError(f"line {frame.line}: '{frame.text}' leaves the straight line of its segment")
            last, quickest = frame.angles[j], max(quickest, -back)
        self.here = end.angles
        even = abs(moved[j]) / n
        peak = max(1.0, (quickest - printed) / even) if even > 0.0 else 1.0
        if passed:
            self.move(end.angles, None if end.event == "move" else 0.0, n / self.rate, peak=peak)
        else:
            self.move(end.angles, None, n / self.rate / peak)
