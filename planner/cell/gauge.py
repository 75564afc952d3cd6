"""A gauge: what it reads, how it stands, where it can read, what a person does; and its section of the cell file.

Each kind is one file in ``planner.gauges``, registered by ``register_gauge``, and has
:class:`planner.effects.gauge_unknowns.GaugeUnknowns` beside this. Everything else asks the gauge, and never its kind.

How a gauge stands, as far as it is known, and what of that is found from a run.

What a gauge shows, where that is more than its readings: all pixels of an image, of which six numbers are kept.

Of most gauges both are the same, and nothing of this is written anew.

Where a gauge can read: its range and cones, how it samples joint states, its bodies, how fast it follows.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BaseModel

from planner.cell.file import CellFile, GaugeFile, PlacedFile
from planner.cell.gauge_session import GaugeReading, GaugeSession, GaugeWay, check_reading_way, check_robot_rests
from planner.cell.gauge_types import FilterStage, GaugeBody, JointSamples, LeftStanding, PointTravel
from planner.cell.parts import Fixture
from planner.cell.placement import P, Placement, Targets
from planner.cell.site import Site
from planner.common.choices import SetUp
from planner.common.errors import InputError
from planner.common.schema import validate
from planner.common.sequences import sobol_points
from planner.common.units import MM, UM, Array, from_deg
from planner.kinematics.chain import ForwardPass
from planner.kinematics.robot import Robot
from planner.runs.run import Mounting, Readings, Run, Samples


@dataclass(frozen=True, kw_only=True)
class GaugeReach:
    """The workspace of a gauge, for candidates, paths and collisions.

    Attributes:
        length_min, length_max: range of the reading [m].
        cone_fixture, cone_map: largest tilt at the place and at the tool point [rad].
        trim: what is left free of bodies before the tool point [m].
        radius: of what stands at the place [m].
        rate, acceleration: largest change of the reading that it follows while it is attached [m/s, m/s²].
        stop_margin: what a plan keeps from either end of the range [m].
    """

    length_min: float = 0.0
    length_max: float = np.inf
    cone_fixture: float = np.pi
    cone_map: float = np.pi
    trim: float = 0.0
    radius: float = 0.0
    rate: float = np.inf
    acceleration: float = np.inf
    stop_margin: float = 0.0

    left_to_person: float = 0.0  # share of the last way to a ball that a person goes, not the program
    is_attached: ClassVar[bool] = False  # whether it is held between a fixture and the tool while it reads
    is_loaded: ClassVar[bool] = False  # whether it pulls
    can_be_loaded: ClassVar[bool] = False  # whether loaded circles can be measured with its kind

    @property
    def planned_range(self) -> tuple[float, float]:
        """Return the shortest and the longest length that a plan uses: the range less the margin at its ends [m]."""
        return self.length_min + self.stop_margin, self.length_max - self.stop_margin

    @property
    def unchecked_length(self) -> float:
        """Return how much of what it holds between fixture and tool no body stands for, at most [m]."""
        return 0.0

    def joint_sampler(self, cell: Site, mounting: Mounting, seed: int) -> Callable[[int], JointSamples]:
        """Return a function that draws a number of joint states; later draws fill the gaps of earlier ones."""
        lower, upper = cell.sampling_range
        draw = sobol_points(len(lower), seed)
        return lambda count: JointSamples(lower + draw(count) * (upper - lower), count)

    @property
    def margin_columns(self) -> tuple[tuple[FilterStage, str], ...]:
        """Filter and name of each margin of :meth:`margins`, filter by filter."""
        return ()

    def margins(self, stage: FilterStage, place: Fixture, p_BM: Array, axis_B: Array) -> Array:
        """Margins of one filter at tool points (n, 3) [m] with axes (n, 3), (n, c) [m or rad]; negative outside."""
        return np.empty((len(p_BM), 0))

    def margin_changes(self, travel: PointTravel) -> list[Array]:
        """Bounds on the change of each margin over neighbourhoods, (m,) each [m or rad]."""
        return []

    def bodies(self, cell: Site) -> list[GaugeBody]:
        """Return the bodies that it brings."""
        return []

    def reach_surfaces(self, cell: Site) -> tuple[tuple[Array, Array, float, float], ...]:
        """Return the surfaces between which it reads: centre (3,) [m], axis (3,), radius [m], opening angle [rad]."""
        return ()

    def fits(self, cell: Site, q: Array, ball: int) -> np.ndarray:
        """Tell at which poses q (n, N) [rad] the tool is turned as a ball allows, (n,) bool."""
        return np.ones(len(q), dtype=bool)

    def retract(self, cell: Site, q: Array, ball: int) -> tuple[Array, Array]:
        """Return where the tool comes from to poses q (n, N) [rad] at a ball, and by how much that misses, (n,) [m]."""
        return q, np.zeros(len(q))

    def tool_speed(self, cell: Site) -> float:
        """Return the limit of the tool point's speed while it is attached or read [m/s]."""
        return cell.motion.tool_speed if cell.motion.is_continuous else np.inf

    def leg_speeds(self, cell: Site, visit: np.ndarray) -> float | Array:
        """Return the speed limits on the legs of a path with visits (m,): one for all, or (m − 1,) [m/s]."""
        return self.tool_speed(cell)


@dataclass(frozen=True, kw_only=True)
class GaugeNumbers:
    """The numbers that a gauge shows before they become readings, and how well its scale is known.

    Attributes:
        stated_scale: one sigma of its scale as its cell states it, relative; without, it is ``usual_scale``.
    """

    stated_scale: float | None = None

    kind: ClassVar[str]  # in cell files
    usual_scale: ClassVar[float] = 1e-5  # one sigma of its scale, as of steel 1 K off: all lengths of the arm have it
    largest_scale: ClassVar[float] = 1e-3  # no more is plausible: steel 30 K off, or all refraction of air, is 3e-4
    wrong_scales: ClassVar[float] = 0.02  # share of runs whose scale or unit is wrong: of hundreds by people a few

    @property
    def scale_sigma(self) -> float:
        """One sigma of its scale, relative: nothing that a run shows tells it from all lengths of the arm."""
        return self.usual_scale if self.stated_scale is None else self.stated_scale

    @property
    @abstractmethod
    def sigmas(self) -> Array:
        """Standard deviation of each number of a reading, (r,) [m, rad]."""

    @abstractmethod
    def residual(self, setup: Placement, samples: Samples, motion: ForwardPass, targets: Targets) -> Array:
        """Return reading − prediction, (n, r) [m, rad], where the motion puts the measured point."""

    @property
    def full_sigmas(self) -> Array:
        """Standard deviation of each number that it shows before they are brought together into a reading, (m,)."""
        return self.sigmas

    def full_reading(self, setup: Placement, samples: Samples, motion: ForwardPass, shown: Array) -> Array:
        """Return the numbers that the gauge shows, (n, m); ``shown`` (n, r) [m, rad]: its own errors in a reading."""
        return shown - self.residual(setup, samples, motion, Targets.at_base(len(samples)))

    def reading_numbers(self, samples: Samples, readings: Readings) -> Array | None:
        """Return the numbers that a run shows, (n, m), NaN where there is none; ``None`` where readings are lengths."""
        return None

    def own_errors(self, setup: Placement, samples: Samples, fitted: Array, left: Array) -> float:
        """Return the rms error of the numbers that it shows, in their unit.

        Args:
            setup: as placed, without fitted errors.
            samples: of the run.
            fitted: what a fit left of these numbers, (n, m).
            left: what is left of the readings where they are judged, held out for instance, (n, r) [m, rad].
        """
        raise TypeError(f"a gauge '{self.kind}' reads lengths alone: there are no other numbers that could be off")

    def own_errors_text(self, before: float, after: float, values: Mapping[str, float]) -> str:
        """Say these errors before and after; ``values`` are those of the fitted parameters by their names."""
        return ""

    def sift(self, cell: Site, run: Run) -> Run:
        """Return the run without what contradicts itself, whatever the robot did, and warnings that say so.

        Raises:
            InputError: hardly anything is left.
        """
        return run


class GaugeFrames(ABC):
    """Places and frames of a gauge: as a run numbers them, found from it, and kept from session to session."""

    frees_base: ClassVar[bool] = False  # whether its frame is free, so that it takes up how the robot's base stands
    set_anew: ClassVar[str] = "zero"  # how the names of its parameters begin that are others in every session

    def declared_frame(self, file: CellFile) -> PlacedFile | None:
        """Return the section of the cell file that says where its frame stands; ``None``: it has no frame."""
        return None

    @abstractmethod
    def number_places(self, setup: P, cell: Site, run: Run) -> P:
        """Return the setup with its places as the run numbers them.

        Raises:
            InputError: the run names one that the cell does not have.
        """

    @abstractmethod
    def place(self, setup: P, run: Run, p_FM: Array | None) -> P:
        """Return the setup with what is not known found from the run; ``p_FM`` (T, 3) [m] where the cell has it.

        Raises:
            InputError, NoSolutionError: the run cannot tell where the gauge stands.
        """

    def lasting_places(self, setup: Placement) -> dict[str, Array] | None:
        """Return places (3,) [m] that stand from session to session by their names; ``None``: not known where."""
        return {}

    def kept_mounting(self, setup: Placement) -> LeftStanding:
        """Return the parts that a later run finds as the last run left them; none if the gauge is set up each time."""
        return LeftStanding()

    def place_nominally(self, setup: P, cell: Site) -> P:
        """Return the setup with its frame where the cell states it, where readings of a run to come depend on that."""
        return setup

    def set_up_again(self, setup: P, cell: Site, run: Run) -> P:
        """Return the setup for the run of a later session, with what was set up anew found from it (or errors)."""
        return setup

    def needs_new_frames(self, setup: Placement, run: Run) -> bool:
        """Tell whether the run stands in frames that the setup does not know."""
        return False


@dataclass(frozen=True, kw_only=True)
class Gauge(GaugeReading, GaugeNumbers, GaugeFrames, GaugeReach, GaugeSession, GaugeWay):
    """What every kind of gauge has and does, and how it is read from a cell file.

    Attributes:
        mounting: name of its set-up, which runs share that find it as the one before has left it; empty: none else has.
    """

    mounting: str = field(default="", compare=False)

    reads_moving: ClassVar[bool] = False  # whether it can be read while the robot moves
    validates_with: ClassVar[int] = 0  # poses of a plan that only validates, where no number is given; 0: it calibrates
    needs_range: ClassVar[bool] = True  # whether planning needs ``gauge.length_mm``
    usual_keys: ClassVar[Mapping[str, Mapping[str, object]]] = {}  # by section: they stand where the cell gives none
    usual_measure: ClassVar[Literal["continuous", "static"]] = "static"  # where the cell does not say
    usual_set_up: ClassVar[SetUp] = "measured"  # of its fixtures, where the cell does not say
    OwnKeys: ClassVar[type[BaseModel] | None] = None  # keys of ``[gauge]`` that only this kind has

    @classmethod
    def read(cls, path: Path, robot: Robot, file: CellFile, planning: bool) -> Self:
        """Return the gauge of a cell file; for identification alone its range may be missing.

        Raises:
            InputError: a key is missing, or contradicts another.
        """
        g = file.gauge
        if g.length_mm is None and planning and cls.needs_range:
            raise InputError(f"{path}: the key 'gauge.length_mm' is missing (shortest and longest length)")
        cls._check_noise(path, g)
        cls._check_scale(path, g)
        way = check_reading_way(path, file, cls)
        if planning:
            check_robot_rests(path, file, way)
        shortest, longest = g.length_mm or (0.0, np.inf)
        return cls(
            noise=(g.noise_um or cls.default_noise_um) * UM,
            stated_scale=None if g.scale_ppm is None else g.scale_ppm * 1e-6,
            noise_angle=float(from_deg(g.noise_mdeg * 1e-3)),
            length_min=shortest * MM,
            length_max=longest * MM,
            cone_fixture=float(from_deg(g.cone_deg.fixture)),
            cone_map=float(from_deg(g.cone_deg.map)),
            trim=g.body.trim_mm * MM,
            read_by=way,
            reading_time=g.reading_s or 0.0,
            **cls.read_own(path, robot, file, planning),
        )

    @staticmethod
    def noise_of_angles(g: GaugeFile) -> float | None:
        """Return the noise of its angles [mdeg], if it is another than the one that plans hold for every gauge."""
        return None if g.noise_mdeg == GaugeFile.model_fields["noise_mdeg"].default else g.noise_mdeg

    @classmethod
    def _check_noise(cls, path: Path, g: GaugeFile) -> None:
        """Refuse the noise of what it does not read."""
        if g.noise_um is not None and cls.angles == cls.width:
            raise InputError(
                f"{path}: 'gauge.noise_um' = {g.noise_um:g}: the gauge '{cls.kind}' reads no length; the noise of its "
                "angles is 'gauge.noise_mdeg'"
            )
        reads_angles = cls.angles > 0 or cls.with_turns is not Gauge.with_turns
        if (given := cls.noise_of_angles(g)) is not None and not reads_angles:
            raise InputError(
                f"{path}: 'gauge.noise_mdeg' = {given:g}: the gauge '{cls.kind}' reads no angle; the noise of "
                "its lengths is 'gauge.noise_um'"
            )

    @classmethod
    def _check_scale(cls, path: Path, g: GaugeFile) -> None:
        """Refuse the scale of lengths of a gauge that reads none."""
        if g.scale_ppm is not None and cls.angles == cls.width:
            raise InputError(f"{path}: 'gauge.scale_ppm' = {g.scale_ppm:g}: the gauge '{cls.kind}' reads no length")

    @classmethod
    def read_own(cls, path: Path, robot: Robot, file: CellFile, planning: bool) -> dict[str, Any]:
        """Return the fields that only this kind has, from ``OwnKeys`` or from sections of the cell file."""
        own = cls.OwnKeys
        return {} if own is None else dict(validate(file.gauge.own, own, f"{path}: [gauge]"))

    @classmethod
    def read_places(cls, path: Path, robot: Robot, file: CellFile) -> tuple[Fixture, ...]:
        """Return the places at which it stands, for planning; an ideal gauge stands nowhere.

        Raises:
            InputError: a section is missing, or one is there that this gauge has no use for.
        """
        return ()

    def with_turns(self, turns: bool) -> "Gauge":
        """Return the gauge that reads orientations as well, where ``turns``: some can, and no cell file says so."""
        return self

    @property
    def travel_name(self) -> str:
        """What the path from home is called."""
        return f"path without the {self.noun}" if self.is_attached else "path to the start"

    @property
    def without_gauge_text(self) -> str:
        """What a program says behind the name of that path."""
        return f", without the {self.noun}" if self.is_attached else ""
