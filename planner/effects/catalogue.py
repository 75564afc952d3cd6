"""The catalogue: the registry of all effects, what of a run excites them, and those that a run can show."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum, auto
from functools import cached_property
from importlib import import_module

import numpy as np

from planner.cell.cell import MeasurementSetup
from planner.cell.placement import N_BASE_TRANSFORMS
from planner.common.determinism import even_positions
from planner.common.errors import InputError, did_you_mean
from planner.common.extensions import is_defined_again, load_extensions
from planner.common.units import Array
from planner.effects.basis import BasisFunction
from planner.effects.context import Context
from planner.effects.effect import Effect
from planner.runs.run import Samples

CONTINUOUS_RUN = 'a run measured while moving (motion.measure = "continuous")'


@dataclass(frozen=True)
class Excitation:
    """A measurement set-up and some samples of a run, evenly spread."""

    setup: MeasurementSetup
    samples: Samples

    @classmethod
    def of(cls, setup: MeasurementSetup, samples: Samples) -> "Excitation":
        """Look at the samples of a run."""
        return cls(setup, samples.take(even_positions(len(samples), 4_000)))  # samples of a run tell what shows in it

    @cached_property
    def context(self) -> Context:
        """The samples as basis functions see them."""
        return Context(self.setup, self.samples)

    @property
    def joints(self) -> range:
        """All joints, from 0."""
        return range(self.setup.robot.n_joints)

    @cached_property
    def turning(self) -> tuple[int, ...]:
        """Joints that turn, from 0."""
        return tuple(int(i) for i in np.flatnonzero(~self.setup.robot.slides))

    @cached_property
    def moving_joints(self) -> tuple[int, ...]:
        """Joints that turn, and stand at more than one angle."""
        return tuple(i for i in self.turning if np.ptp(self.samples.q[:, i]) > LEAST_MOTION)

    @cached_property
    def moving_slides(self) -> tuple[int, ...]:
        """Joints that slide, and stand at more than one place."""
        return tuple(i for i in self.joints if i not in self.turning and np.ptp(self.samples.q[:, i]) > LEAST_MOTION)

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
        return round(float(self.context.column("temperature").mean()), 2)

    @cached_property
    def start(self) -> float:
        """Time of the first sample [s]."""
        return float(self.context.column("t").min())

    @cached_property
    def duration(self) -> float:
        """Time from first to last sample [s], 0 without a clock."""
        return 0.0 if self.samples.t is None else float(np.ptp(self.samples.t))

    @property
    def middle_time(self) -> float:
        """Time halfway from first to last sample [s]."""
        return self.start + self.duration / 2

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


SHIPPED = (
    "compliance", "gears", "backlash", "thermal", "gauge_errors", "set_up_errors", "sessions", "nonparametric", "steps",
    "slides",
)  # fmt: skip
LEAST_MOTION = 1e-3  # [rad] of a joint that moves in a run
EffectGenerator = Callable[[Excitation], Iterator[Effect]]


class Background(Enum):
    """How effects of a kind that were not found enter the posterior."""

    BY_KIND = auto()
    """With one size for all places, since a run says little of each."""
    BY_PLACE = auto()
    """With a size at each place."""
    COMMON = auto()
    """With a size at each place, likely whatever else an arm has. Example: joint compliance, as all joints yield."""
    KNOWN = auto()
    """With the size that is expected: a run says nothing of it. Its findings do not enter the robot."""
    OF_SHAPE = auto()
    """Not at all, found or not, as smooth errors of the gauge stand for them. Example: sag of a wire."""
    OF_RUN = auto()
    """Not at all, found or not: it acts by what a run logs and no program knows, and with the pose as others do, which
    stand for it. Example: compliance under a drive's torque, most of which is that of gravity."""
    NAMED_ONLY = auto()
    """Not at all, unless found: what hardly any arm has, or other columns stand for."""


@dataclass(frozen=True)
class Registration:
    """Kinds of effects.

    Attributes:
        kinds: their names.
        generator: yields those of them that a run can show.
        needs: what a run needs to show them.
        by_gauge: whether a gauge names the generator among its own errors, see ``Gauge.errors``.
        background: how effects that were not found enter the posterior.
    """

    kinds: tuple[str, ...]
    generator: EffectGenerator
    needs: str
    by_gauge: bool
    background: Background

    @property
    def order(self) -> int:
        """Position of its file among those that come with the package, behind them for any other."""
        module = self.generator.__module__.removeprefix(f"{__package__}.")
        return SHIPPED.index(module) if module in SHIPPED else len(SHIPPED)


_REGISTRY: list[Registration] = []


def register(
    *kinds: str,
    needs: str = "another kind of run",
    by_gauge: bool = False,
    background: Background = Background.BY_KIND,
) -> Callable[[EffectGenerator], EffectGenerator]:
    """Register a generator of effects under the names of the kinds that it yields, see :class:`Registration`.

    A generator that is defined again in the same place, as by a cell of a notebook that is run twice, takes the place
    of the one before.

    Raises:
        ValueError: another generator yields a kind of that name, and it is not one that several gauges have.
    """

    def enter(generator: EffectGenerator) -> EffectGenerator:
        """Put what makes the effects into the catalogue, once for each kind."""
        if not generator.__module__.startswith(f"{__package__}."):
            _import_shipped_modules()  # so that who takes one of their names is the one who is told
        again = [r for r in _REGISTRY if set(kinds) & set(r.kinds) and is_defined_again(r.generator, generator)]
        for other in (r for r in _REGISTRY if r not in again):
            if (taken := set(kinds) & set(other.kinds)) and not (by_gauge and other.by_gauge):
                raise ValueError(f"effect '{taken.pop()}': {other.generator.__module__} has registered it already")
        _REGISTRY[:] = [r for r in _REGISTRY if r not in again]
        _REGISTRY.append(Registration(kinds, generator, needs, by_gauge, background))
        return generator

    return enter


def _import_shipped_modules() -> None:
    for name in SHIPPED:
        import_module(f"{__package__}.{name}")


def registrations() -> list[Registration]:
    """Return all registered effects in the order of the catalogue, which is that of their files."""
    _import_shipped_modules()
    load_extensions()
    return sorted(_REGISTRY, key=lambda r: r.order)


def effect_kinds() -> tuple[str, ...]:
    """Return the names of all kinds of effects."""
    return tuple(dict.fromkeys(kind for r in registrations() for kind in r.kinds))


def registration_of(kind: str) -> Registration:
    """Return the entry of a kind."""
    return next(r for r in registrations() if kind in r.kinds)


def needs_of(kind: str) -> str:
    """Return the conditions that a run must meet to show effects of a kind."""
    return next((r.needs for r in registrations() if kind in r.kinds), "another kind of run")


def strip_repeat(name: str) -> str:
    """Return the name of an effect without its number, where it came again: ``gear ripple (2), joint 1``."""
    return re.sub(r" \(\d+\)(?=, |$)", "", name)


def check_effect_name(name: str, n_joints: int, where: str) -> None:
    """Check that an effect is one that there is, on a joint that an arm of ``n_joints`` has.

    Args:
        name: ``encoder once a turn, joint 2``.
        n_joints: joints of the robot.
        where: file and place of the name, for the message.

    Raises:
        InputError: with the nearest kind, or the joints that there are.
    """
    kind, comma, place = strip_repeat(name).partition(", ")
    kinds = effect_kinds()
    if kind not in kinds or not comma:
        allowed = "" if comma else "; it is called KIND, PLACE, like 'backlash, joint 2'"
        raise InputError(
            f"{where}: '{name}' is no effect{did_you_mean(kind, list(kinds))}{allowed} (known kinds:"
            f" {', '.join(kinds)})"
        )
    for part, most in (("joint", n_joints), ("link", n_joints + 1)):
        for numbers in re.findall(rf"\b{part}s? (\d+(?:, \d+)*)", place):
            if not all(1 <= int(number) <= most for number in numbers.split(", ")):
                raise InputError(f"{where}: '{name}': the robot has {part}s 1 to {most}")


def catalogue(setup: MeasurementSetup, samples: Samples) -> tuple[Effect, ...]:
    """Return every effect that the set-up can have and the samples can tell of.

    What needs a column that was not logged, or that never changes, is left out. Effects stand in a fixed order.
    """
    excitation = Excitation.of(setup, samples)
    return tuple(effect for r in registrations() if not r.by_gauge for effect in r.generator(excitation))
