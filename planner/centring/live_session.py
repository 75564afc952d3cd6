"""A session with a bar or wire, read pose by pose: a port is read, or a person types what the gauge shows.

A bar or wire on a serial port, read pose by pose of a plan into a run.
"""

import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
import serial

from planner.cell.cell import Cell
from planner.centring.assumptions import AGREEING_READINGS, FAR_FROM_PLAN
from planner.centring.indicators import LINE_ERRORS
from planner.centring.settings import PROTOCOLS
from planner.centring.stop import SilentError, UnsettledError
from planner.common.errors import InputError
from planner.common.files import write_text
from planner.common.units import MM, Array, from_deg, read_only, to_mm
from planner.runs.loader import load_run
from planner.runs.run import Readings, Run, Samples
from planner.runs.writer import run_text
from planner.session.document import PlanDocument, PoseRecord

STREAM = "stream"  # the gauge sends by itself, one reading a line
NUMBER = re.compile(rb"[-+]?\s*\d+(?:[.,]\d+)?")


@dataclass
class LiveGauge:
    """A length gauge on a serial port.

    Attributes:
        port, baud: of the line; ``protocol`` ``stream`` or one of ``PROTOCOLS``, which is asked.
        factor, zero: ``factor`` times what it sends, plus ``zero``, is the reading [m].
    """

    port: str
    baud: int
    protocol: str = STREAM
    factor: float = MM
    zero: float = 0.0
    line: serial.Serial = field(init=False)

    def __post_init__(self) -> None:
        try:
            self.line = serial.serial_for_url(self.port, self.baud, timeout=0.05, exclusive=True)
        except LINE_ERRORS as err:
            raise InputError(f"the gauge's port {self.port} cannot be opened ({err})") from err

    def read(self) -> float:
        """Return the next reading [m].

        Raises:
            SilentError: none comes.
        """
        silence = 2.0  # [s] without a reading
        until, last = time.monotonic() + silence, b""
        try:
            while time.monotonic() < until:
                if self.protocol != STREAM:
                    self.line.reset_input_buffer()
                    self.line.write(PROTOCOLS[self.protocol].request(1))
                last = self._next_line() or last
                if (value := self._value(last)) is not None:
                    return value * self.factor + self.zero
        except LINE_ERRORS as err:
            raise SilentError(
                f"the gauge on {self.port} does not answer any more ({err}). Is its adapter still plugged in?"
            ) from err
        raise SilentError(
            f"the gauge on {self.port} sent {last!r} within {silence:g} s, which is no reading: are --baud and "
            "--protocol its own?"
        )

    def _next_line(self) -> bytes:
        got, until = b"", time.monotonic() + 0.5
        while time.monotonic() < until and not got.endswith((b"\r", b"\n")):
            got += self.line.read(1)
        return got.strip()

    def _value(self, line: bytes) -> float | None:
        """The reading of a line in the gauge's own unit."""
        if self.protocol != STREAM:
            found = PROTOCOLS[self.protocol].value(line, 1)
            return None if found is None else found / MM
        numbers = NUMBER.findall(line)
        return float(numbers[-1].replace(b" ", b"").replace(b",", b".")) if numbers else None

    def read_settled_mean(self) -> float:
        """Read until enough readings in a row agree, and return their mean [m].

        Raises:
            UnsettledError: they never do.
        """
        self.line.reset_input_buffer()
        last: list[float] = []
        for _ in range(60):  # readings at most until they agree
            last = [*last[1 - AGREEING_READINGS :], self.read()]
            if len(last) == AGREEING_READINGS and np.ptp(last) <= 0.05 * MM:
                return float(np.mean(last))
        raise UnsettledError(
            f"the gauge's last {AGREEING_READINGS} readings still spread over {float(to_mm(np.ptp(last))):.3f} mm"
        )


@dataclass
class PoseLog:
    """The run as it grows: poses of the plan that are measured, with their readings [m] and times [s]."""

    output: Path
    plan: PlanDocument
    cell: Cell
    rows: dict[int, tuple[float, float]] = field(default_factory=dict)

    @property
    def poses(self) -> tuple[PoseRecord, ...]:
        """The poses that are measured, in their order."""
        return tuple(p for p in self.plan.poses if p.role != "mount")

    def add(self, pose: int, t: float, length: float) -> None:
        """Keep a reading; the run is written whole.

        Raises:
            InputError: it cannot be written, and the reading is not kept.
        """
        grown = replace(self, rows=self.rows | {pose: (t, length)})
        write_text(self.output, run_text(grown.run()), own=True)  # it was read, to go on with it
        self.rows[pose] = (t, length)

    def is_readable(self, pose: int, length: float) -> bool:
        """Return whether the gauge can have read this length [m]: not pulled off, at a stop, or an error's number."""
        run = replace(self, rows={pose: (0.0, length)}).run()
        return bool(self.cell.gauge.tell_readable(run).all())

    def is_stuck(self) -> bool:
        """Return whether the last readings repeat one number, though their poses are of different lengths."""
        some = 3  # readings in a row that nobody takes for chance
        ids = list(self.rows)[-some:]
        planned = [p.length_mm for p in self.poses if p.id in ids and p.length_mm is not None]
        same = len({self.rows[k][1] for k in ids}) == 1
        return same and len(planned) == some and float(np.ptp(planned)) * MM > FAR_FROM_PLAN

    def run(self) -> Run:
        """Return the run measured so far, in the order in which it was read."""
        done = sorted((p for p in self.poses if p.id in self.rows), key=lambda p: self.rows[p.id][0])
        places = tuple(f.name for f in self.cell.fixtures)
        mountings = self.cell.mountings_of(done, self.output)
        q = read_only(from_deg([p.q_deg for p in done]))
        t, length = np.array([self.rows[p.id] for p in done]).T
        samples = Samples(q, np.array([m.fixture for m in mountings]), t=read_only(t), q_cmd=q)
        samples = replace(samples, pose=np.array([p.id for p in done]), direction=_approaches(done))
        points = tuple(p.name for p in self.cell.tool.points)
        if len(points) > 1:
            samples = replace(samples, point=np.array([m.point for m in mountings]))
        run = Run(self.output.stem, samples, Readings(length=read_only(length)), places, points=points)
        run = replace(run, slides=self.cell.robot.slide_numbers)
        return replace(run, plan_id=self.plan.plan_id, robot=self.plan.robot)


def _approaches(poses: Sequence[PoseRecord]) -> Array | None:
    return read_only(np.array([p.approach for p in poses], dtype=float)) if all(p.approach for p in poses) else None


def open_log(output: Path, plan: PlanDocument, cell: Cell) -> PoseLog:
    """Begin a run, or go on with the one that was begun in ``output``.

    Raises:
        InputError: not a .csv, or it belongs to another plan.
    """
    if output.suffix != ".csv":
        raise InputError(f"{output}: readings are written as .csv")
    log = PoseLog(output, plan, cell)
    if output.exists():
        run = load_run(output, cell.robot.n_joints)
        s = run.samples
        if run.plan_id != plan.plan_id or s.pose is None or s.t is None or run.readings.length is None:
            raise InputError(f"{output}: is no run of plan {plan.plan_id}; give another file with -o")
        log.rows = {int(p): (float(t), float(v)) for p, t, v in zip(s.pose, s.t, run.readings.length, strict=True)}
    return log


WORDS = "b: the pose before once more, p N: pose N, s: leave it out, q: end"
TYPED = re.compile(r"[-+]?\d+(?:[.,]\d+)?(?:\s*mm)?")


class Adviser(Protocol):
    """Says of each pose whether it need not be read, and after each reading where the session stands."""

    def passes(self, pose: int) -> str:
        """Return why the pose of this id need not be read; empty where it is to be read."""

    def advise(self, pose: int, t: float, length: float) -> str:
        """Take a reading [m] at a time [s] of the session; return what to tell the person, empty where nothing."""

    def correct(self, rows: Mapping[int, tuple[float, float]]) -> str:
        """Take all readings anew, one of them was corrected: times [s] and lengths [m] by the id of their pose."""


class NoAdvice:
    """All poses are read, and nothing is said of them."""

    def passes(self, pose: int) -> str:
        """Return nothing."""
        return ""

    def advise(self, pose: int, t: float, length: float) -> str:
        """Return nothing."""
        return ""

    def correct(self, rows: Mapping[int, tuple[float, float]]) -> str:
        """Return nothing."""
        return ""


@dataclass(frozen=True)
class Answer:
    """What is done at a pose: its length [m] is kept, another pose is next, it is left out, or the session ends."""

    what: Literal["keep", "go", "skip", "end"]
    length: float = 0.0
    pose: int = 0


@dataclass
class MeasuringSession:
    """Ticks off the poses of a plan, each when a person says that the arm rests there.

    Poses have the numbers that the program shows at the pendant. What the gauge cannot have read is not kept. A pose
    that the ``adviser`` passes is not asked for: the arm drives on through it, along the path that was proven.

    Attributes:
        log: the run as it grows.
        ask: shows a text and returns the answer.
        clock: time [s].
        read: returns the gauge's reading [m]; ``None``: a person types it.
        factor, zero: ``factor`` [m] times what a person types, plus ``zero`` [m], is the reading.
        adviser: see there.
    """

    log: PoseLog
    ask: Callable[[str], str]
    clock: Callable[[], float]
    read: Callable[[], float] | None = None
    factor: float = MM
    zero: float = 0.0
    adviser: Adviser = field(default_factory=NoAdvice)

    def run(self) -> Iterator[str]:
        """Measure the poses that are left, in the order of the plan; yield what is said of each."""
        poses, rows = self.log.poses, self.log.rows
        start = self.clock() - max((t + 1.0 for t, _ in rows.values()), default=0.0)
        at, passed = 0, set[int]()
        once_more: int | None = None  # a pose that was read already: after it the session goes on where it was
        while True:
            if at == len(poses) and once_more is None:
                if left := [str(p.id) for p in poses if p.id not in rows and p.id not in passed]:
                    few = f"pose{'s' if len(left) > 1 else ''} {', '.join(left)}"
                    yield f"not read yet: {few}; p N asks for one, or the same command later"
                answer = self._closing_answer()
                if answer.what == "end":
                    return
                once_more = self._number(answer.pose)
            pose = poses[at if once_more is None else once_more]
            if once_more is None and pose.id in rows:
                at += 1
                continue
            if once_more is None and (why := self.adviser.passes(pose.id)):
                yield f"pose {pose.id}: drive on, {why}"
                passed.add(pose.id)
                at += 1
                continue
            answer = self._answer(poses.index(pose))
            if answer.what == "end":
                return
            if answer.what == "go":
                goal = self._number(answer.pose)
                once_more, at = (goal, at) if answer.pose in rows else (None, goal)
                continue
            if answer.what == "keep":
                yield self._keep(pose, answer.length, round(self.clock() - start, 3))
            is_done = answer.what == "skip" or pose.id in rows
            at, once_more = at + (once_more is None and is_done), None

    def _number(self, pose: int) -> int:
        """Return which in the order of the plan the pose of this id is."""
        return next(k for k, p in enumerate(self.log.poses) if p.id == pose)

    def _closing_answer(self) -> Answer:
        """Ask behind the last pose whether one is to be put right."""
        asked = "behind the last pose: q ends (b: the last pose once more, p N: pose N)"
        while True:
            said = self.ask(asked)
            if said in ("", "s", "q"):
                return Answer("end")
            if (pose := self._goal(said, len(self.log.poses))) is not None:
                return Answer("go", pose=pose)

    def _goal(self, said: str, at: int) -> int | None:
        """Return the id of the pose that an answer asks for at the pose of this number in the order; or none."""
        poses = self.log.poses
        wanted = poses[at - 1].id if said == "b" and at > 0 else None
        if found := re.fullmatch(r"p\s*(\d+)", said):
            wanted = int(found[1])
        return wanted if wanted in {p.id for p in poses} else None

    def _answer(self, at: int) -> Answer:
        """Ask at the pose of this number in the order until something is said that can be done."""
        poses, pose = self.log.poses, self.log.poses[at]
        planned = "" if pose.length_mm is None else f", planned {pose.length_mm:.2f} mm"
        wanted = "type what the gauge shows in mm" if self.read is None else "Enter reads"
        where = f"pose {pose.id} of {max(p.id for p in poses)} at {pose.fixture or 'the gauge'}{planned}"
        asked = f"{where}: {wanted} ({WORDS})"
        while True:
            said = self.ask(asked)
            if said in ("s", "q"):
                return Answer("skip" if said == "s" else "end")
            if (goal := self._goal(said, at)) is not None:
                return Answer("go", pose=goal)
            length = self._length(said)
            if length is None:
                asked = f"pose {pose.id}: '{said}' is no answer here: {wanted} ({WORDS})"
            elif self.log.is_readable(pose.id, length):
                return Answer("keep", length)
            else:
                asked = (
                    f"pose {pose.id}: {float(to_mm(length)):.3f} mm is beyond the gauge's range and not kept (pulled "
                    f"off, at a stop, or no reading): {wanted} ({WORDS})"
                )

    def _length(self, said: str) -> float | None:
        """Return the reading that an answer gives [m]: that of the port, or what was typed."""
        if said == "" and self.read is not None:
            return self.read()
        if not TYPED.fullmatch(said):
            return None
        return float(said.removesuffix("mm").strip().replace(",", ".")) * self.factor + self.zero

    def _keep(self, pose: PoseRecord, length: float, t: float) -> str:
        """Keep a reading, and return what is said of it; a correction that is typed has the time of the pose."""
        corrected = self.log.rows.get(pose.id)
        if corrected is not None and self.read is None:
            t = corrected[0]
        try:
            self.log.add(pose.id, t, length)
        except InputError as err:  # another program has the run open, or the disk is full
            return f"pose {pose.id}: not kept; read it again. {err}"
        off = length - (pose.length_mm or float(to_mm(length))) * MM
        far = (
            f", {float(to_mm(off)):+.1f} mm from the plan: is this the pose, and the zero set?"
            if abs(off) > FAR_FROM_PLAN
            else ""
        )
        far += "; the gauge has shown this number at three poses: does it still move?" if self.log.is_stuck() else ""
        before = "" if corrected is None else f" in place of {float(to_mm(corrected[1])):.3f} mm"
        rows = self.log.rows
        stands = self.adviser.advise(pose.id, t, length) if corrected is None else self.adviser.correct(rows)
        count = f"({len(rows)} of {len(self.log.poses)})"
        return f"pose {pose.id}: {float(to_mm(length)):.3f} mm{before}{far} {count}{'; ' if stands else ''}{stands}"


def program_remark(read_by: str) -> str:
    """Return what a person must know of the plan's program before the first pose."""
    if read_by == "hand":
        return (
            "the program stops at each pose and names it by the same number: take the reading here, then let the "
            "program go on at the pendant"
        )
    return (
        f'the program of this plan does not wait for a person (read_by = "{read_by}"): stop it at each pose, or write '
        'read_by = "hand" under [gauge] of the cell and plan again'
    )
