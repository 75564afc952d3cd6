"""An effect: a physical cause at one place and its parameters; and what the samples of a run excite."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.cell.setup import N_BASE_TRANSFORMS, MeasurementSetup
from planner.common.determinism import even_positions
from planner.common.units import Array
from planner.effects.basis import Phi
from planner.effects.context import Context
from planner.effects.load_functions import StationTwist
from planner.effects.parameters import Parameter, ParameterMove
from planner.runs.run import Samples


@dataclass(frozen=True)
class NonlinearParameter:
    """A number inside the basis functions that is not known beforehand: a frequency, a time constant, a lag.

    Attributes:
        name, unit: for instance ``frequency`` and ``1/turn``.
        values: the grid that is scanned, fine enough that neighbours look alike, (m,).
        log: whether the grid's steps grow with the value.
    """

    name: str
    unit: str
    values: Array
    log: bool = False


@dataclass(frozen=True)
class Effect:
    """One physical cause at one place.

    Attributes:
        kind: for instance ``gear ripple``; ``on``: ``joint 3``, ``base``, ``gauge``.
        make: its parameters for a value of the inner number (``None`` where there is none).
        sentence: what a mechanic would say, with ``{size}`` and, where there is one, ``{inner}`` to be filled in.
        largest: size beyond which it is not plausible, in the unit of its parameters.
        source: where kind and size come from.
        inner: the number to be scanned.
        static: whether it depends on joint angles and loads alone, so that targets can be compensated for it.
    """

    kind: str
    on: str
    make: Callable[[float | None], tuple[Parameter, ...]]
    sentence: str
    largest: float
    source: str
    inner: NonlinearParameter | None = None
    static: bool = True

    @property
    def name(self) -> str:
        """``gear ripple, joint 3``: the group of its parameters."""
        return f"{self.kind}, {self.on}"


SAMPLES_LOOKED_AT = 4_000  # samples of a long run that are looked at


@dataclass(frozen=True)
class Excitation:
    """A setup and some samples of the run, evenly spread, with what the entries ask of them."""

    setup: MeasurementSetup
    samples: Samples

    @classmethod
    def of(cls, setup: MeasurementSetup, samples: Samples) -> "Excitation":
        """Look at the samples of a run."""
        n = len(samples)
        return cls(setup, samples.take(even_positions(n, SAMPLES_LOOKED_AT)))

    @cached_property
    def context(self) -> Context:
        """The samples as basis functions see them."""
        return Context(self.setup, self.samples)

    @property
    def n_joints(self) -> int:
        """Number of joints N."""
        return self.setup.robot.n_joints

    @cached_property
    def moving(self) -> tuple[int, ...]:
        """Joints that stand at more than one angle."""
        return tuple(int(i) for i in np.flatnonzero(np.ptp(self.samples.q, axis=0) > 1e-3))

    def theta(self, joint: int) -> int:
        """Position of a joint's rotation in the setup's chain."""
        return int(self.context.joints[joint])

    @cached_property
    def lengths(self) -> tuple[tuple[int, float], ...]:
        """The robot's nominal lengths: position in the setup's chain, and value [m]."""
        robot = enumerate(self.setup.robot.transforms)
        return tuple(
            (N_BASE_TRANSFORMS + k, t.nominal) for k, t in robot if t.kind == "translation" and t.nominal != 0.0
        )

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


def with_group(kind: str, on: str, *parameters: Parameter) -> tuple[Parameter, ...]:
    """Put the parameters of an entry into a group of its name."""
    return tuple(replace(p, group=f"{kind}, {on}") for p in parameters)


def effect_of(
    kind: str, on: str, parameters: Iterable[Parameter], sentence: str, largest: float, source: str, static: bool = True
) -> Effect:
    """Make an entry without an inner number."""
    known = with_group(kind, on, *parameters)
    return Effect(kind, on, lambda _: known, sentence, largest, source, None, static)


def twist_moves(station: int, axis: int, by: Phi) -> tuple[ParameterMove, ...]:
    """Turn everything beyond a station about one of its axes, which need not be a transform of its own."""
    return tuple(ParameterMove("transform", part, StationTwist(station, axis, part, by)) for part in range(6))


def value_range(values: Array) -> float:
    """Range of some values."""
    return float(np.ptp(values))
