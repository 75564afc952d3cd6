"""What a gauge reads: prediction, derivative, noise, what a run of it looks like."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from planner.cell.placement import Placement, Targets
from planner.cell.site import Site
from planner.common.errors import InputError
from planner.common.units import Array
from planner.kinematics.chain import ForwardPass
from planner.runs.run import NO_REFERENCE_READINGS, Readings, ReferenceReadings, Run, Samples


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
