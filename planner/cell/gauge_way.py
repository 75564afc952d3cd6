"""How a reading is taken at a pose: one word of the cell file, from which programs, pages and times follow."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from planner.cell.file import CellFile
from planner.common.choices import ReadBy
from planner.common.errors import InputError


@dataclass(frozen=True, kw_only=True)
class GaugeWay:
    """How a gauge is read where the robot rests.

    Attributes:
        read_by: the way.
        reading_time: for which the robot waits there for a person or an input [s], as the cell states it.
    """

    read_by: ReadBy = "log"
    reading_time: float = 0.0

    ways_to_read: ClassVar[tuple[ReadBy, ...]] = ("log", "hand", "trigger", "input")  # the usual one first
    # [s] of one reading for which the robot waits, where the cell does not say: a person looks at the gauge, writes the
    # value down and presses a key; a gauge comes to rest, reads and answers
    usual_reading_times: ClassVar[Mapping[ReadBy, float]] = {"hand": 20.0, "input": 2.0}

    @property
    def reading_seconds(self) -> float:
        """Time that one reading takes beyond what the robot stands still by itself [s]."""
        return self.reading_time

    @property
    def drives_on_when_read(self) -> bool:
        """Return whether the robot drives on as soon as a person has read, without a dwell."""
        return self.read_by == "hand"

    @classmethod
    def reading_text(cls, file: CellFile) -> str:
        """Say what program and person do for each reading."""
        way = file.gauge.read_by or cls.ways_to_read[0]
        return describe_reading_way(file, way, file.gauge.reading_s or cls.usual_reading_times.get(way, 0.0))


def check_reading_way(path: Path, file: CellFile, kind: type[GaugeWay]) -> ReadBy:
    """Return how the gauge of a cell file is read; the first of its kind's ways where the file is silent.

    Raises:
        InputError: the gauge is not read so, the signal for it has no number, or a time is given that nobody waits.
    """
    gauge, signals, ways = file.gauge, file.controller, kind.ways_to_read
    way = gauge.read_by or ways[0]
    if way not in ways:
        allowed = " or ".join(f'"{w}"' for w in ways)
        raise InputError(f"{path}: 'gauge.read_by' = \"{way}\": a gauge '{gauge.kind}' is read by {allowed}")
    if way == "trigger" and signals.sync_output is None:
        raise InputError(
            f"{path}: 'gauge.read_by' = \"trigger\" needs 'controller.sync_output', the number of the output that "
            "triggers the gauge"
        )
    if way == "input" and signals.gauge_input is None:
        raise InputError(
            f"{path}: 'gauge.read_by' = \"input\" needs 'controller.gauge_input', the number of the input that the "
            "gauge sets"
        )
    if gauge.reading_s is not None and way not in kind.usual_reading_times:
        raise InputError(
            f"{path}: 'gauge.reading_s' = {gauge.reading_s:g}, but no robot waits for a gauge that is read by "
            f'"{way}"; it stands still for motion.settle_s and motion.dwell_s'
        )
    return way


def check_robot_rests(path: Path, file: CellFile, way: ReadBy) -> None:
    """Refuse to wait for a reading where the robot does not rest.

    Raises:
        InputError: naming both keys.
    """
    if way in ("hand", "input") and file.motion.measure == "continuous":
        raise InputError(
            f"{path}: 'gauge.read_by' = \"{way}\" lets the robot wait at each pose, and motion.measure is "
            f'"continuous", without a stop; write measure = "static", or read_by = "log"'
        )


def describe_reading_way(file: CellFile, way: ReadBy, seconds: float) -> str:
    """Say what program and person do for each reading, in sentences.

    Args:
        file: of the cell.
        way: how the gauge is read.
        seconds: of one reading, for which the robot waits [s].
    """
    return " ".join([_at_each_pose(file, way, seconds), *_at_the_start(file, way)])


def _at_each_pose(file: CellFile, way: ReadBy, seconds: float) -> str:
    motion, output = file.motion, file.controller.sync_output
    marks = "" if output is None else f" Output {output} is pulsed at each pose."
    if motion.measure == "continuous":
        return f"The gauge's own log runs while the robot drives; the program waits for no reading.{marks}"
    still = f"the robot stands still for {motion.settle_s:g} s"
    reckoned = f"The planned time counts {seconds:g} s for each reading."
    if way == "hand":
        return (
            f"At each pose {still}, then the program stops and names the pose: read the gauge, write the value down "
            f"beside the pose's number, and let the program go on (the Start key on most controllers). "
            f"{reckoned}{marks}"
        )
    if way == "input":
        return (
            f"At each pose {still}{'' if output is None else f' and output {output} is pulsed'}. After "
            f"{motion.dwell_s:g} s more it waits until input {file.controller.gauge_input} is on, which the gauge sets "
            "once it has read, and which is off again before the next pose. Where nothing is wired to it the robot "
            f"waits for ever. {reckoned}"
        )
    if way == "trigger":
        return (
            f"At each pose {still}, then output {output} is pulsed: it triggers the gauge. After {motion.dwell_s:g} s "
            "more the robot drives on."
        )
    return (
        f"At each pose the robot stands still for {motion.settle_s + motion.dwell_s:g} s and drives on by itself: the "
        f"gauge's own log runs from the first pose to the last. Where a person reads the gauge, write "
        f'read_by = "hand" under [gauge] of the cell, and plan again.{marks}'
    )


def _at_the_start(file: CellFile, way: ReadBy) -> tuple[str, ...]:
    """Say that the program waits for an input before the first pose, where the cell names one."""
    number = file.controller.gauge_input
    if number is None:
        return ()
    return (
        f"Before the first pose the program waits until input {number} says that the gauge is ready. Where nothing is "
        "wired to it, leave gauge_input out of the cell: the program would wait for ever.",
    )
