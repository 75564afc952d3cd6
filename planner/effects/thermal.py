"""Effects of temperature and time: thermal growth, drift and warm-up."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from planner.common.units import Array
from planner.effects.basis import Phi, Times
from planner.effects.context import Context
from planner.effects.effect import Effect, Excitation, NonlinearParameter, effect_of, with_group
from planner.effects.parameters import Parameter, ParameterMove, reading_move, transform_move


@dataclass(frozen=True)
class TemperatureRise:
    """φ = temperature − about [K]."""

    about: float

    @property
    def key(self) -> str:
        """``warmth:21.5``."""
        return f"warmth:{self.about!r}"

    def __call__(self, c: Context) -> Array:
        """Return the difference."""
        assert c.samples.temperature is not None
        return c.samples.temperature - self.about


@dataclass(frozen=True)
class ElapsedTime:
    """φ = time since ``start`` [s]."""

    start: float

    @property
    def key(self) -> str:
        """``elapsed:0.0``."""
        return f"elapsed:{self.start!r}"

    def __call__(self, c: Context) -> Array:
        """Return the time."""
        assert c.samples.t is not None
        return c.samples.t - self.start


@dataclass(frozen=True)
class WarmUp:
    """φ = 1 − exp(−(t − start)/τ): one body that warms up to a new balance (Newton's law of cooling)."""

    start: float
    constant: float

    @property
    def key(self) -> str:
        """``warm-up:0.0:900.0``."""
        return f"warm-up:{self.start!r}:{self.constant!r}"

    def __call__(self, c: Context) -> Array:
        """Return the part of the way that is done."""
        assert c.samples.t is not None
        return np.asarray(-np.expm1(-(c.samples.t - self.start) / self.constant))


@dataclass(frozen=True)
class InSession:
    """φ = 1 in one session, else 0."""

    session: int

    @property
    def key(self) -> str:
        """``session:2``."""
        return f"session:{self.session}"

    def __call__(self, c: Context) -> Array:
        """Return the indicator."""
        return np.asarray(c.samples.session == self.session, dtype=float)


@dataclass(frozen=True)
class MountedAnew:
    """φ = 1 at one place in one session, else 0: where a fixture stands after it was mounted anew."""

    place: int
    session: int

    @property
    def key(self) -> str:
        """``remounted:0:2``."""
        return f"remounted:{self.place}:{self.session}"

    def __call__(self, c: Context) -> Array:
        """Return the indicator."""
        return np.asarray((c.samples.session == self.session) & (c.samples.place == self.place), dtype=float)


GROWTH, LARGEST_GROWTH = 1.2e-5, 1e-4  # [1/K] steel; several times as much where the air is not as warm as the arm
DRIFT_TURN, LARGEST_DRIFT_TURN = 2e-4, 5e-3  # [rad] over a run
DRIFT_SHIFT, LARGEST_DRIFT_SHIFT = 5e-5, 3e-3  # [m] over a run
TIME_CONSTANTS = 12  # time constants that are scanned
SOURCE_DRIFT = "Heisel, Richter & Wurst 1997, CIRP Annals 46(1): thermal behaviour of industrial robots, 0.1 to 0.5 mm"
SOURCE_EXPANSION = "thermal expansion of steel and aluminium, 11 to 24e-6 1/K"


@dataclass(frozen=True)
class ThermalCause:
    """Heat or time as φ, its unit, and its largest size in the run; ``word`` names the kind."""

    word: str
    phi: Phi
    per: str
    size: float
    how: str


def link_growth(site: Excitation) -> Iterator[Effect]:
    """All links grow alike."""
    if not site.varies("temperature"):
        return
    warmth = TemperatureRise(site.warmth)
    parameter = Parameter("link_growth", "1/K", GROWTH, "thermal growth of all links", _link_lengths(site, warmth))
    sentence = "the arm's links grow with temperature, by {size}"
    yield effect_of("link growth", "arm", [parameter], sentence, LARGEST_GROWTH, SOURCE_EXPANSION, False)


def drift(site: Excitation) -> Iterator[Effect]:
    """Joints, base and gauge that move with temperature, or steadily in time."""
    for cause in _causes(site):
        for i in range(site.n_joints):
            moved = transform_move(site.theta(i), cause.phi)
            name = f"{cause.word.replace(' ', '_')}{i + 1}"
            size = DRIFT_TURN / cause.size
            what = f"{cause.word} of joint {i + 1}"
            parameter = Parameter(name, f"rad/{cause.per}", size, what, moved)
            sentence = f"joint {i + 1}: its zero drifts {cause.how}, {{size}}"
            yield _drift_effect(cause.word, f"joint {i + 1}", [parameter], sentence, LARGEST_DRIFT_TURN / cause.size)
        yield from _frame_drift(site, cause)


def warm_up(site: Excitation) -> Iterator[Effect]:
    """Joints, links and base that warm up to a new balance, with a time constant that nobody knows."""
    if not site.timed:
        return
    inner = NonlinearParameter(
        "time constant", "s", np.geomspace(site.duration / 50, site.duration * 2, TIME_CONSTANTS), True
    )
    for i in range(site.n_joints):
        sentence = f"joint {i + 1}: warms up over {{inner}} and moves by {{size}}"
        make = partial(_joint_warm_up, site, i)
        yield Effect("warm-up", f"joint {i + 1}", make, sentence, LARGEST_DRIFT_TURN, SOURCE_DRIFT, inner, False)
    sentence = "the arm's links warm up over {inner} and grow by {size}"
    yield Effect("warm-up", "arm", partial(_link_warm_up, site), sentence, 1e-3, SOURCE_DRIFT, inner, False)
    sentence = "the base warms up over {inner} and moves by {size}"
    yield Effect(
        "warm-up", "base", partial(_base_warm_up, site), sentence, LARGEST_DRIFT_SHIFT, SOURCE_DRIFT, inner, False
    )


def _causes(site: Excitation) -> Iterator[ThermalCause]:
    if site.varies("temperature"):
        warmth = TemperatureRise(site.warmth)
        yield ThermalCause("thermal drift", warmth, "K", site.largest(warmth), "with temperature")
    if site.timed:
        yield ThermalCause("drift", ElapsedTime(site.start), "s", site.duration, "steadily")


def _frame_drift(site: Excitation, cause: ThermalCause) -> Iterator[Effect]:
    label, unit = cause.word.replace(" ", "_"), f"m/{cause.per}"
    prior, largest = DRIFT_SHIFT / cause.size, LARGEST_DRIFT_SHIFT / cause.size
    shifts = [
        Parameter(f"{label}_base_{a}", unit, prior, f"{cause.word} of the base along {a}", transform_move(k, cause.phi))
        for k, a in enumerate("xyz")
    ]
    sentence = f"base and gauge drift apart {cause.how}, {{size}}"
    yield _drift_effect(cause.word, "base", shifts, sentence, largest)
    turns = [
        Parameter(
            f"{label}_base_r{a}", f"rad/{cause.per}", DRIFT_TURN / cause.size, f"{cause.word} of the base about {a}",
            transform_move(3 + k, cause.phi),
        )
        for k, a in enumerate("xyz")
    ]  # fmt: skip
    sentence = f"the base tilts {cause.how}, {{size}}"
    largest_turn = LARGEST_DRIFT_TURN / cause.size
    yield _drift_effect(cause.word, "base tilt", turns, sentence, largest_turn)
    if site.setup.gauge.has_zero:
        zero = Parameter(f"{label}_zero", unit, prior, f"{cause.word} of the gauge's zero", reading_move(cause.phi))
        sentence = f"the gauge's zero drifts {cause.how}, {{size}}"
        yield _drift_effect(cause.word, "gauge", [zero], sentence, largest)


def _drift_effect(kind: str, on: str, parameters: Sequence[Parameter], sentence: str, largest: float) -> Effect:
    return effect_of(kind, on, parameters, sentence, largest, SOURCE_DRIFT, False)


def _link_lengths(site: Excitation, phi: Phi) -> tuple[ParameterMove, ...]:
    return tuple(ParameterMove("transform", k, Times(phi, value)) for k, value in site.lengths)


def _warm_up_function(site: Excitation, constant: float | None) -> WarmUp:
    assert constant is not None
    return WarmUp(site.start, constant)


def _joint_warm_up(site: Excitation, joint: int, constant: float | None) -> tuple[Parameter, ...]:
    moves = transform_move(site.theta(joint), _warm_up_function(site, constant))
    what = f"warm-up of joint {joint + 1}"
    return with_group("warm-up", f"joint {joint + 1}", Parameter(f"warm_up{joint + 1}", "rad", DRIFT_TURN, what, moves))


def _link_warm_up(site: Excitation, constant: float | None) -> tuple[Parameter, ...]:
    moves = _link_lengths(site, _warm_up_function(site, constant))
    return with_group(
        "warm-up", "arm", Parameter("warm_up_links", "1", 1e-4, "growth of all links by warming up", moves)
    )


def _base_warm_up(site: Excitation, constant: float | None) -> tuple[Parameter, ...]:
    phi = _warm_up_function(site, constant)
    shifts = (
        Parameter(f"warm_up_base_{a}", "m", DRIFT_SHIFT, f"warm-up of the base along {a}", transform_move(k, phi))
        for k, a in enumerate("xyz")
    )
    return with_group("warm-up", "base", *shifts)
