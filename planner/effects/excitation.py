"""What the samples of a run excite: which joints move, which logged quantities vary."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.cell.setup import N_BASE_TRANSFORMS, MeasurementSetup
from planner.common.determinism import even_positions
from planner.common.units import Array
from planner.effects.basis import BasisFunction
from planner.effects.context import Context
from planner.runs.run import Samples

SAMPLES_LOOKED_AT = 4_000
CONTINUOUS_RUN = 'a run measured while moving (motion.measure = "continuous")'


@dataclass(frozen=True)
class Excitation:
    """A measurement set-up and some samples of a run, evenly spread."""

    setup: MeasurementSetup
    samples: Samples

    @classmethod
    def of(cls, setup: MeasurementSetup, samples: Samples) -> "Excitation":
        """Look at the samples of a run."""
        return cls(setup, samples.take(even_positions(len(samples), SAMPLES_LOOKED_AT)))

    @cached_property
    def context(self) -> Context:
        """The samples as basis functions see them."""
        return Context(self.setup, self.samples)

    @property
    def joints(self) -> range:
        """All joints, from 0."""
        return range(self.setup.robot.n_joints)

    @cached_property
    def moving_joints(self) -> tuple[int, ...]:
        """Joints that stand at more than one angle."""
        return tuple(int(i) for i in np.flatnonzero(np.ptp(self.samples.q, axis=0) > 1e-3))

    def rotation(self, joint: int) -> int:
        """Position of a joint's rotation in the chain."""
        return int(self.context.joints[joint])

    @cached_property
    def lengths(self) -> tuple[tuple[int, float], ...]:
        """The robot's nominal lengths: position in the chain, and value [m]."""
        robot = enumerate(self.setup.robot.transforms)
        return tuple((N_BASE_TRANSFORMS + k, t.nominal) for k, t in robot if t.kind == "translation" and t.nominal)

    def has(self, column: str) -> bool:
        """Whether a column was logged."""
        return getattr(self.samples, column, None) is not None

    def varies(self, column: str) -> bool:
        """Whether a column was logged, and is not the same for all samples."""
        values = getattr(self.samples, column, None)
        return values is not None and bool(np.any(np.ptp(values, axis=0) > 0))

    @cached_property
    def mean_temperature(self) -> float:
        """Mean temperature [°C], to a hundredth."""
        assert self.samples.temperature is not None
        return round(float(self.samples.temperature.mean()), 2)

    @cached_property
    def start(self) -> float:
        """Time of the first sample [s]."""
        assert self.samples.t is not None
        return float(self.samples.t.min())

    @cached_property
    def duration(self) -> float:
        """Time from first to last sample [s], 0 without a clock."""
        return 0.0 if self.samples.t is None else float(np.ptp(self.samples.t))

    @cached_property
    def sessions(self) -> tuple[int, ...]:
        """Sessions after the first."""
        return () if self.samples.session is None else tuple(int(s) for s in np.unique(self.samples.session)[1:])

    def values(self, phi: BasisFunction) -> Array:
        """Return a basis function over the samples."""
        return self.context.value(phi)

    def largest(self, phi: BasisFunction) -> float:
        """Largest size of a basis function over the samples."""
        return float(np.abs(self.values(phi)).max())
