"""What a person does with a gauge, and the words in which plans, programs and reports speak of it.

How a reading is taken at a pose: one word of the cell file, from which programs, pages and times follow.

What a gauge reads: prediction, derivative, noise, what a run of it looks like.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from planner.cell.file import CellFile
from planner.cell.gauge_types import PlannedVisit, RecordedPose, SessionGuide
from planner.cell.parts import IndicatorHead
from planner.cell.placement import Placement, Targets
from planner.cell.site import Site
from planner.common.choices import ReadBy
from planner.common.errors import InputError
from planner.common.units import Array
from planner.kinematics.chain import ForwardPass
from planner.runs.run import NO_REFERENCE_READINGS, Mounting, Readings, ReferenceReadings, Run, Samples


@dataclass(frozen=True, kw_only=True)
class GaugeReading(ABC):
    """One reading: a function of where the motion puts the measured point, with its derivative and its noise.

    Attributes:
        noise: standard deviation of one number of a reading [m]; ``noise_angle`` of one angle [rad].
        zero_free: whether its readings have a zero that is unknown.
    """

    noise: float
    noise_angle: float = 1e-4
    zero_free: bool = False

    kind: ClassVar[str]  # in cell files
    columns: ClassVar[str]  # of a run that hold its readings
    plural: ClassVar[str]  # what its readings are called
    width: ClassVar[int] = 1  # numbers in one reading
    angles: ClassVar[int] = 0  # how many of them, at the end, are angles
    unit: ClassVar[str] = "mm"  # what a thousandth of the first number is called: "mrad" where that is an angle
    default_noise_um: ClassVar[float]
    has_zero: ClassVar[bool] = False  # whether its readings have a zero of their own
    at_balls: ClassVar[bool] = False  # whether each pose is at one of the balls or sockets of an artifact

    @property
    def sigmas(self) -> Array:
        """Standard deviation of each number of a reading, (r,) [m, rad], without the robot's repeatability."""
        return np.array([self.noise] * (self.width - self.angles) + [self.noise_angle] * self.angles)

    def sigmas_of(self, samples: Samples) -> Array:
        """Standard deviation of each number of every reading, (n, r), or (1, r) where all are alike [m, rad]."""
        return self.sigmas[None]

    @abstractmethod
    def residual(self, setup: Placement, samples: Samples, motion: ForwardPass, targets: Targets) -> Array:
        """Return reading − prediction, (n, r) [m, rad], where the motion puts the measured point."""

    @abstractmethod
    def project(self, setup: Placement, samples: Samples, motion: ForwardPass, which: np.ndarray) -> Array:
        """Return the change of the reading per unit of the transforms ``which``, (k, r, n): projected screws."""

    @abstractmethod
    def targets(self, setup: Placement, samples: Samples, readings: Readings) -> Targets:
        """Bring readings to the base frame, as far as it is known where the gauge stands."""

    @abstractmethod
    def readings(self, values: Array) -> Readings:
        """Return the readings of a run that show the values (n, r) [m, rad]."""

    def simulate(
        self, cell: Site, samples: Samples, predict: Callable[[Samples], Array],
        slopes: Callable[[Samples], Array], noise: Array,
    ) -> tuple[Samples, Readings]:  # fmt: skip
        """Return samples as they are recorded and their readings.

        Args:
            cell: the cell.
            samples: where the arm is told to stand.
            predict: exact readings for samples, (n, r) [m, rad], in the base frame.
            slopes: their derivative by the joint angles, (n, r, N).
            noise: of each number, (n, r) [m, rad].
        """
        return samples, self.readings(predict(samples) + noise)

    def reference_readings(self, cell: Site, rng: np.random.Generator) -> ReferenceReadings:
        """Return the readings that are taken before the poses."""
        return NO_REFERENCE_READINGS

    def tell_readable(self, run: Run) -> np.ndarray:
        """Tell which readings of a run the gauge can have made, (n,) bool: none of those beyond its stops."""
        return np.ones(len(run), dtype=bool)

    def range_warnings(self, readings: Readings) -> tuple[str, ...]:
        """Say how many simulated readings the gauge could not have made."""
        return ()

    def check_run(self, cell: Site, run: Run) -> None:
        """Check that the run's readings can be this gauge's.

        Raises:
            InputError: another gauge's readings, or they look like another unit.
        """
        if self.columns != run.readings.columns:
            raise InputError(
                f"{run.name}: has readings '{run.readings.columns}', but the gauge '{self.kind}' of {cell.path} gives "
                f"'{self.columns}'"
            )

    @abstractmethod
    def coordinates(self, setup: Placement, samples: Samples, motion: ForwardPass) -> Iterator[tuple[str, Array]]:
        """Yield what a residual may depend on, by name: where the gauge reads, (n, k) or (n,)."""

    def pull_direction(self, setup: Placement, samples: Samples, motion: ForwardPass) -> Array | None:
        """Direction (n, 3) from the place to the tool point, along which it pulls; ``None``: it does not pull."""
        return None


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


@dataclass(frozen=True, kw_only=True)
class GaugeSession:
    """A session with a gauge.

    Attributes:
        head: indicators that are centred on balls, where it has them.
    """

    head: IndicatorHead | None = None

    kind: ClassVar[str]  # in cell files
    columns: ClassVar[str]  # of a run that hold its readings
    noun: ClassVar[str] = "gauge"  # what reports and messages call it
    pose_columns: ClassVar[tuple[str, str]] = ("place", "reading (mm)")  # of a table of poses: where, and a figure
    removal: ClassVar[str] = ""  # what a person does after the last pose

    @property
    def ends(self) -> tuple[str, str]:
        """What stands at its place in the cell, and what sits on the tool, in a word each."""
        return "fixture", "ball"

    @property
    def measuring_command(self) -> str:
        """How the session of a plan is measured; ``PLAN`` stands for its path."""
        return "run the program and log it (to try it: edbb simulate PLAN -o run.csv)"

    @property
    def indicators(self) -> IndicatorHead:
        """Return the head of indicators, for what only such a head can do.

        Raises:
            InputError: there is none.
        """
        if self.head is None:
            raise InputError(f"a gauge '{self.kind}' has no head of indicators, which this needs")
        return self.head

    def mastered_reading(self, cell: Site) -> float | None:
        """Return the indicators' readings at the master ball [m]; ``None`` where nothing is mastered."""
        return None

    def ball_to_centre(self, cell: Site, q: Array) -> int | None:
        """Return which ball is centred at q (N,) [rad]; ``None`` where no ball is."""
        return None

    def centring_warnings(self, cell: Site, planned: Samples, run: Run) -> tuple[str, ...]:
        """Say how many poses of a simulated run were met further off than the gauge can read."""
        return ()

    def preparation(self, cell: Site, mounting: Mounting) -> tuple[str, str]:
        """Return the instructions to a person before the first pose, an explanation (may be empty) and an action."""
        return "", "set the gauge to zero"

    def session_names(self, cell: Site, mounting: Mounting) -> tuple[str, str]:
        """Return the words for the place where a session starts, and for what it measures from there."""
        return "where the session starts", "measuring"

    def seating_step(self, cell: Site, q: Array) -> str:
        """Return the instruction to a person at a pose q (N,) [rad] before it is read; empty where there is none."""
        return ""

    def start_states(self, q: Array) -> Array | None:
        """Return the states (n, N) [rad] among which a session starts; ``None``: where the tool's axis points up."""
        return q

    def plan_errors(self, cell: Site, poses: Sequence[RecordedPose], plan: Path) -> Array:
        """Return by how much each pose misses what the plan at ``plan`` says of it, (n,) [mm]."""
        return np.zeros(len(poses))

    def plan_error_text(self, pose: int, error: float) -> str:
        """Say by how many millimetres the pose with this id misses what the gauge holds it to."""
        return f"pose {pose} is {error:.3f} mm off its ball"

    @classmethod
    def session_guide(cls, file: CellFile) -> SessionGuide:
        """Return the steps that a person at the cell takes with the gauge."""
        return SessionGuide(f"the gauge's reading ({cls.columns})")

    def describe(self, cell: Site) -> str:
        """Say what stands where, for the heading of a report."""
        return self.kind

    def visit_cells(self, cell: Site, visit: PlannedVisit) -> tuple[str, str]:
        """Return where a pose is measured and its figure, under ``pose_columns``."""
        return cell.place_name(visit.mounting), ""

    def length_text(self, length: float) -> str:
        """Say a planned length [m] where it is what the gauge reads, else nothing."""
        return ""

    def visit_record(self, cell: Site, visit: PlannedVisit) -> dict[str, object]:
        """Return the keys of a pose in ``plan.json`` beside its angles: the gauge's place, if it has a name."""
        return cell.place_record(visit.mounting) if cell.names_of(visit.mounting)[0] else {}

    def path_facts(self, shortest: float, longest: float) -> tuple[tuple[str, str], ...]:
        """Say the lengths [m] along a path, where they matter: (what, value)."""
        return ()
