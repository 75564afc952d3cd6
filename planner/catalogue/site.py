"""What the entries of a catalogue are made from: a rig, and a look at the samples of a run."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.catalogue.types import Entry
from planner.effects import Context
from planner.effects.basis import Phi
from planner.effects.loads import Twist
from planner.model import Move, Parameter
from planner.repeatable import evenly
from planner.rig import HEAD, Rig
from planner.run import Samples
from planner.units import Array

LOOK = 4_000  # samples of a long run that are looked at


@dataclass(frozen=True)
class Site:
    """A rig and some samples of the run, evenly spread, with what the entries ask of them."""

    rig: Rig
    samples: Samples

    @classmethod
    def of(cls, rig: Rig, samples: Samples) -> "Site":
        """Look at the samples of a run."""
        n = len(samples)
        return cls(rig, samples.take(evenly(n, LOOK)))

    @cached_property
    def context(self) -> Context:
        """The samples as basis functions see them."""
        return Context(self.rig, self.samples)

    @property
    def n_joints(self) -> int:
        """Number of joints N."""
        return self.rig.robot.n_joints

    @cached_property
    def moving(self) -> tuple[int, ...]:
        """Joints that stand at more than one angle."""
        return tuple(int(i) for i in np.flatnonzero(np.ptp(self.samples.q, axis=0) > 1e-3))

    def theta(self, joint: int) -> int:
        """Position of a joint's rotation in the rig's chain."""
        return int(self.context.joints[joint])

    @cached_property
    def lengths(self) -> tuple[tuple[int, float], ...]:
        """The robot's nominal lengths: position in the rig's chain, and value [m]."""
        robot = enumerate(self.rig.robot.transforms)
        return tuple((HEAD + k, t.nominal) for k, t in robot if t.kind == "translation" and t.nominal != 0.0)

    def varies(self, column: str) -> bool:
        """Whether a column was logged, and is not the same for all samples."""
        values = getattr(self.samples, column, None)
        return values is not None and bool(np.any(np.ptp(values, axis=0) > 0))

    @cached_property
    def warmth(self) -> float:
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
        """Time from first to last sample [s]."""
        return 0.0 if self.samples.t is None else float(np.ptp(self.samples.t))

    @property
    def timed(self) -> bool:
        """Whether there is a clock that runs."""
        return self.duration > 0.0

    @cached_property
    def sessions(self) -> tuple[int, ...]:
        """Sessions after the first."""
        return () if self.samples.session is None else tuple(int(s) for s in np.unique(self.samples.session)[1:])

    def largest(self, phi: Phi) -> float:
        """Largest size of a basis function over the samples."""
        return float(np.abs(phi(self.context)).max())


def named(kind: str, on: str, *parameters: Parameter) -> tuple[Parameter, ...]:
    """Put the parameters of an entry into a group of its name."""
    return tuple(replace(p, group=f"{kind}, {on}") for p in parameters)


def entry(
    kind: str, on: str, parameters: Iterable[Parameter], sentence: str, largest: float, source: str, static: bool = True
) -> Entry:
    """Make an entry without an inner number."""
    known = named(kind, on, *parameters)
    return Entry(kind, on, lambda _: known, sentence, largest, source, None, static)


def twisting(station: int, axis: int, by: Phi) -> tuple[Move, ...]:
    """Turn everything beyond a station about one of its axes, which need not be a transform of its own."""
    return tuple(Move("transform", part, Twist(station, axis, part, by)) for part in range(6))


def spread(values: Array) -> float:
    """Range of some values."""
    return float(np.ptp(values))
