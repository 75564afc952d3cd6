"""What a gauge shows, where that is more than its readings: all pixels of an image, of which six numbers are kept.

Of most gauges both are the same, and nothing of this is written anew.
"""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from planner.cell.placement import Placement, Targets
from planner.cell.site import Site
from planner.common.units import Array
from planner.kinematics.chain import ForwardPass
from planner.runs.run import Readings, Run, Samples


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
