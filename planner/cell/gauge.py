"""The protocol of a gauge: each kind is one file in ``planner.gauges`` and is registered by ``register_gauge``.

Everything else asks the gauge, and never its kind, what a reading is, where it reads, and what is unknown of it.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BaseModel

from planner.cell.file import CellFile, PlacedFile
from planner.cell.gauge_types import (
    FilterStage,
    GaugeBody,
    JointSamples,
    PlannedVisit,
    PointTravel,
    RecordedPose,
    SessionGuide,
)
from planner.common.choices import SetUp
from planner.common.errors import InputError
from planner.common.schema import validate
from planner.common.sequences import sobol_points
from planner.common.units import MM, UM, Array, from_deg
from planner.kinematics.chain import ForwardPass
from planner.kinematics.robot import Robot
from planner.runs.run import NO_REFERENCE_READINGS, Mounting, Readings, ReferenceReadings, Run, Samples

if TYPE_CHECKING:
    from planner.cell.cell import Cell, Fixture, IndicatorHead
    from planner.cell.setup import MeasurementSetup, Targets


@dataclass(frozen=True)
class Gauge(ABC):
    """What every kind of gauge has and does.

    Attributes:
        noise: standard deviation of one number of a reading [m]; ``noise_angle`` of one angle [rad].
        length_min, length_max: range of the reading [m].
        cone_fixture, cone_map: largest tilt at the place and at the tool point [rad].
        trim: what is left free of bodies before the tool point [m].
        radius: of what stands at the place [m].
        zero_free: whether its readings have a zero that is unknown.
        rate, acceleration: largest change of the reading that it follows while it is attached [m/s, m/s²].
        stop_margin: what a plan keeps from either end of the range [m].
        head: indicators that are centred on balls, where it has them.
    """

    noise: float
    noise_angle: float = 1e-4
    length_min: float = 0.0
    length_max: float = np.inf
    cone_fixture: float = np.pi
    cone_map: float = np.pi
    trim: float = 0.0
    radius: float = 0.0
    zero_free: bool = False
    rate: float = np.inf
    acceleration: float = np.inf
    stop_margin: float = 0.0
    head: "IndicatorHead | None" = None

    kind: ClassVar[str]
    noun: ClassVar[str] = "gauge"  # what reports and messages call it
    default_noise_um: ClassVar[float]
    columns: ClassVar[str]  # of a run that hold its readings
    plural: ClassVar[str]  # what its readings are called
    width: ClassVar[int] = 1  # numbers in one reading
    angles: ClassVar[int] = 0  # how many of them, at the end, are angles
    needs_range: ClassVar[bool] = True  # whether planning needs ``gauge.length_mm``
    pose_columns: ClassVar[tuple[str, str]] = ("place", "reading (mm)")  # of a table of poses: where, and a figure
    removal: ClassVar[str] = ""  # what a person does after the last pose
    usual_keys: ClassVar[Mapping[str, Mapping[str, object]]] = {}  # by section: they stand where the cell gives none
    measured_by: ClassVar[str] = "run the program and log it (to try it: edbb simulate PLAN -o run.csv)"
    at_balls: ClassVar[bool] = False  # whether each pose is at one of the balls or sockets of an artifact
    usual_scale: ClassVar[float] = 1e-5  # one sigma of its scale, as of steel 1 K off: all lengths of the arm have it
    largest_scale: ClassVar[float] = 1e-3  # no more is plausible: steel 30 K off, or all refraction of air, is 3e-4
    left_to_person: float = 0.0  # share of the last way to a ball that a person goes, not the program
    reads_moving: ClassVar[bool] = False  # whether it can be read while the robot moves
    usual_measure: ClassVar[Literal["continuous", "static"]] = "static"  # where the cell does not say
    usual_set_up: ClassVar[SetUp] = "measured"  # of its fixtures, where the cell does not say
    can_be_loaded: ClassVar[bool] = False  # whether loaded circles can be measured with its kind
    is_loaded: ClassVar[bool] = False  # whether it pulls
    validates_with: ClassVar[int] = 0  # poses of a plan that only validates, where no number is given; 0: it calibrates
    is_attached: ClassVar[bool] = False  # whether it is held between a fixture and the tool while it reads
    has_zero: ClassVar[bool] = False  # whether its readings have a zero of their own
    set_anew: ClassVar[str] = "zero"  # how the names of its parameters begin that are others in every session
    frees_base: ClassVar[bool] = False  # whether its frame is free, so that it takes up how the robot's base stands
    OwnKeys: ClassVar[type[BaseModel] | None] = None  # keys of ``[gauge]`` that only this kind has

    # ---- the cell file

    @classmethod
    def read(cls, path: Path, robot: Robot, file: CellFile, planning: bool) -> Self:
        """Return the gauge of a cell file; for identification alone its range may be missing.

        Raises:
            InputError: a key is missing, or contradicts another.
        """
        g = file.gauge
        if g.length_mm is None and planning and cls.needs_range:
            raise InputError(f"{path}: the key 'gauge.length_mm' is missing (shortest and longest length)")
        shortest, longest = g.length_mm or (0.0, np.inf)
        return cls(
            noise=(g.noise_um or cls.default_noise_um) * UM,
            noise_angle=float(from_deg(g.noise_mdeg * 1e-3)),
            length_min=shortest * MM,
            length_max=longest * MM,
            cone_fixture=float(from_deg(g.cone_deg.fixture)),
            cone_map=float(from_deg(g.cone_deg.map)),
            trim=g.body.trim_mm * MM,
            **cls.read_own(path, robot, file, planning),
        )

    @classmethod
    def read_own(cls, path: Path, robot: Robot, file: CellFile, planning: bool) -> dict[str, Any]:
        """Return the fields that only this kind has, from ``OwnKeys`` or from sections of the cell file."""
        own = cls.OwnKeys
        return {} if own is None else dict(validate(file.gauge.own, own, f"{path}: [gauge]"))

    @classmethod
    def read_places(cls, path: Path, robot: Robot, file: CellFile) -> tuple["Fixture", ...]:
        """Return the places at which it stands, for planning; an ideal gauge stands nowhere.

        Raises:
            InputError: a section is missing, or one is there that this gauge has no use for.
        """
        return ()

    @property
    def planned_range(self) -> tuple[float, float]:
        """Return the shortest and the longest length that a plan uses: the range less the margin at its ends [m]."""
        return self.length_min + self.stop_margin, self.length_max - self.stop_margin

    @property
    def unchecked_length(self) -> float:
        """Return how much of what it holds between fixture and tool no body stands for, at most [m]."""
        return 0.0

    # ---- one reading

    @property
    def sigmas(self) -> Array:
        """Standard deviation of each number of a reading, (r,) [m, rad], without the robot's repeatability."""
        return np.array([self.noise] * (self.width - self.angles) + [self.noise_angle] * self.angles)

    @abstractmethod
    def residual(self, setup: "MeasurementSetup", samples: Samples, motion: ForwardPass, targets: "Targets") -> Array:
        """Return reading − prediction, (n, r) [m, rad], where the motion puts the measured point."""

    @abstractmethod
    def project(self, setup: "MeasurementSetup", samples: Samples, motion: ForwardPass, which: np.ndarray) -> Array:
        """Return the change of the reading per unit of the transforms ``which``, (k, r, n): projected screws."""

    @abstractmethod
    def targets(self, setup: "MeasurementSetup", samples: Samples, readings: Readings) -> "Targets":
        """Bring readings to the base frame, as far as it is known where the gauge stands."""

    @abstractmethod
    def readings(self, values: Array) -> Readings:
        """Return readings with the values (n, r) [m, rad]."""

    def simulate(
        self, cell: "Cell", samples: Samples, predict: Callable[[Samples], Array],
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

    def reference_readings(self, cell: "Cell", rng: np.random.Generator) -> ReferenceReadings:
        """Return what is read before the poses."""
        return NO_REFERENCE_READINGS

    def readable(self, run: Run) -> np.ndarray:
        """Tell which readings of a run the gauge can have made, (n,) bool: none of those beyond its stops."""
        return np.ones(len(run), dtype=bool)

    def range_warnings(self, readings: Readings) -> tuple[str, ...]:
        """Say how many simulated readings the gauge could not have made."""
        return ()

    def centring_warnings(self, cell: "Cell", planned: Samples, run: Run) -> tuple[str, ...]:
        """Say how many poses of a simulated run were met further off than the gauge can read."""
        return ()

    def with_turns(self, turns: bool) -> "Gauge":
        """Return the gauge that reads orientations as well, where ``turns``: some can, and no cell file says so."""
        return self

    # ---- a session with it

    @property
    def travel_name(self) -> str:
        """What the way from home is called."""
        return f"way without the {self.noun}" if self.is_attached else "way to the start"

    @property
    def bare(self) -> str:
        """What a program says of that way."""
        return f", without the {self.noun}" if self.is_attached else ""

    @property
    def reading_seconds(self) -> float:
        """Time that one reading takes beyond the dwell [s]."""
        return 0.0

    @property
    def indicators(self) -> "IndicatorHead":
        """The head of indicators, where only that will do.

        Raises:
            InputError: there is none.
        """
        if self.head is None:
            raise InputError(f"a gauge '{self.kind}' has no head of indicators, which this needs")
        return self.head

    def mastered_reading(self, cell: "Cell") -> float | None:
        """Return what indicators show at the master ball [m]; ``None`` where nothing is mastered."""
        return None

    def preparation(self, cell: "Cell", mounting: Mounting) -> tuple[str, str]:
        """Return what is explained to a person before the first pose, and what the person does then."""
        return "", "set the gauge to zero"

    def session_names(self, cell: "Cell", mounting: Mounting) -> tuple[str, str]:
        """Return what a session calls the pose where it starts and what it measures from there."""
        return "where the session starts", "measuring"

    def ball_to_centre(self, cell: "Cell", q: Array) -> int | None:
        """Return which ball is centred at q (N,) [rad]; ``None`` where no ball is."""
        return None

    def seating(self, cell: "Cell", q: Array, pose: int) -> str:
        """Return what a person does at a pose before it is read, q (N,) [rad]; empty where nothing."""
        return ""

    def retract(self, cell: "Cell", q: Array, ball: int) -> tuple[Array, Array]:
        """Return where the tool comes from to poses q (n, N) [rad] at a ball, and by how much that misses, (n,) [m]."""
        return q, np.zeros(len(q))

    def starts_among(self, q: Array) -> Array | None:
        """Return the states (n, N) [rad] among which a session starts; ``None``: where the tool's axis points up."""
        return q

    def fits(self, cell: "Cell", q: Array, ball: int) -> np.ndarray:
        """Tell at which poses q (n, N) [rad] the tool is turned as a ball allows, (n,) bool."""
        return np.ones(len(q), dtype=bool)

    def tool_speed(self, cell: "Cell") -> float:
        """Return the limit of the tool point's speed while it is attached or read [m/s]."""
        return cell.motion.tool_speed if cell.motion.is_continuous else np.inf

    def leg_speeds(self, cell: "Cell", visit: np.ndarray) -> float | Array:
        """Return the same on the legs of a path with visits (m,), one for all or (m − 1,) [m/s]."""
        return self.tool_speed(cell)

    def plan_errors(self, cell: "Cell", poses: Sequence[RecordedPose], plan: Path) -> Array:
        """Return by how much each pose misses what the plan at ``plan`` says of it, (n,) [mm]."""
        return np.zeros(len(poses))

    def plan_error_text(self, pose: int, error: float) -> str:
        """Say such an error [mm] of the pose with that id."""
        return f"pose {pose} is {error:.3f} mm off its ball"

    @classmethod
    def session_guide(cls, file: CellFile) -> SessionGuide:
        """Return what a person at the cell does with it."""
        return SessionGuide(f"the gauge's reading ({cls.columns})")

    def describe(self, cell: "Cell") -> str:
        """Say what stands where, for the heading of a report."""
        return self.kind

    def visit_cells(self, cell: "Cell", visit: PlannedVisit) -> tuple[str, str]:
        """Return where a pose is measured and its figure, under ``pose_columns``."""
        return cell.place_name(visit.mounting), ""

    def length_text(self, length: float) -> str:
        """Say a planned length [m] where it is what the gauge reads, else nothing."""
        return ""

    def visit_record(self, cell: "Cell", visit: PlannedVisit) -> dict[str, object]:
        """Return what ``plan.json`` says of a pose beside its angles."""
        return {}

    def path_facts(self, shortest: float, longest: float) -> tuple[tuple[str, str], ...]:
        """Say the lengths [m] along a path, where they matter: (what, value)."""
        return ()

    def reach_surfaces(self, cell: "Cell") -> tuple[tuple[Array, Array, float, float], ...]:
        """Return the surfaces between which it reads: centre (3,) [m], axis (3,), radius [m], opening angle [rad]."""
        return ()

    # ---- what is unknown of it

    @abstractmethod
    def parameters(self, setup: "MeasurementSetup", free: frozenset[str]) -> Iterator[Any]:
        """Yield the parameters that place the gauge and the targets on the tool."""

    @abstractmethod
    def lag_moves(self) -> tuple[Any, ...]:
        """Return how a late clock shows in the reading, per second."""

    def errors(self, run: Any) -> Iterator[Any]:
        """Yield the effects of the catalogue that are errors of the gauge itself."""
        return iter(())

    @abstractmethod
    def coordinates(self, context: Any) -> Iterator[tuple[str, Array]]:
        """Yield what a residual may depend on, by name: where the gauge reads, (n, k) or (n,)."""

    def pull_direction(self, context: Any) -> Array | None:
        """Direction (n, 3) from the place to the tool point, along which it pulls; ``None``: it does not pull."""
        return None

    # ---- frames to be found

    def declared_frame(self, file: CellFile) -> PlacedFile | None:
        """Return the section of the cell file that says where its frame stands; ``None``: it has no frame."""
        return None

    @abstractmethod
    def number_places(self, setup: "MeasurementSetup", cell: "Cell", run: Run) -> "MeasurementSetup":
        """Return the setup with its places as the run numbers them.

        Raises:
            InputError: the run names one that the cell does not have.
        """

    @abstractmethod
    def place(self, setup: "MeasurementSetup", run: Run, p_FM: Array | None) -> "MeasurementSetup":
        """Return the setup with what is not known found from the run; ``p_FM`` (T, 3) [m] where the cell has it.

        Raises:
            InputError, NoSolutionError: the run cannot tell where the gauge stands.
        """

    def lasting_places(self, setup: "MeasurementSetup") -> dict[str, Array] | None:
        """Return places (3,) [m] that stand from session to session by their names; ``None``: not known where."""
        return {}

    def set_up_again(self, setup: "MeasurementSetup", cell: "Cell", run: Run) -> "MeasurementSetup":
        """Return the setup for the run of a later session, with what was set up anew found from it (or errors)."""
        return setup

    def needs_new_frames(self, setup: "MeasurementSetup", run: Run) -> bool:
        """Tell whether the run stands in frames that the setup does not know."""
        return False

    def check_run(self, cell: "Cell", run: Run) -> None:
        """Check that the run's readings can be this gauge's.

        Raises:
            InputError: another gauge's readings, or they look like another unit.
        """
        if self.columns != run.readings.columns:
            raise InputError(
                f"{run.name}: has readings '{run.readings.columns}', but the gauge '{self.kind}' of {cell.path} gives "
                f"'{self.columns}'"
            )

    # ---- where it reads

    def joint_sampler(self, cell: "Cell", mounting: Mounting, seed: int) -> Callable[[int], JointSamples]:
        """Return what draws joint states, as many as it is told; successive draws fill the gaps of those before."""
        lower, upper = cell.sampling_range
        draw = sobol_points(len(lower), seed)
        return lambda count: JointSamples(lower + draw(count) * (upper - lower), count)

    @property
    def margin_columns(self) -> tuple[tuple[FilterStage, str], ...]:
        """Filter and name of each margin of :meth:`margins`, filter by filter."""
        return ()

    def margins(self, stage: FilterStage, place: "Fixture", p_BM: Array, axis_B: Array) -> Array:
        """Margins of one filter at tool points (n, 3) [m] with axes (n, 3), (n, c) [m or rad]; negative outside."""
        return np.empty((len(p_BM), 0))

    def margin_changes(self, travel: PointTravel) -> list[Array]:
        """Bounds on the change of each margin over neighbourhoods, (m,) each [m or rad]."""
        return []

    def bodies(self, cell: "Cell") -> list[GaugeBody]:
        """Return the bodies that it brings."""
        return []
