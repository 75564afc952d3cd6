"""A bar or wire on a serial port, read pose by pose of a plan into a run."""

import re
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

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
        return same and len(planned) == some and np.ptp(planned) * MM > FAR_FROM_PLAN

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
