"""Effects of temperature and time: thermal growth, drift and warm-up.

What temperature and time are counted from is a number of its own, frozen with the effect. All of it is nought on
average over the run, so that the robot beside it is the arm as it was on average, and not as it was at the start.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from planner.common.units import Array
from planner.effects.basis import BasisFunction, EffectVariable, Less, Times
from planner.effects.catalogue import Excitation, register
from planner.effects.context import Context
from planner.effects.effect import (
    BASE_SHIFTS,
    BASE_TURNS,
    Effect,
    Parameter,
    ParameterMove,
    Place,
    Role,
    ShapeParameter,
    joint_place,
    reading_move,
    transform_move,
)
from planner.effects.sizes import DRIFT_SHIFT, DRIFT_TURN, EXPANSION, HEISEL, SIGMAS_OF_LARGEST, THERMAL_GROWTH


def temperature_variable(phi: BasisFunction, c: Context) -> EffectVariable:
    """Draw an effect against the temperature."""
    return EffectVariable("temperature (°C)", c.column("temperature"))


def time_variable(phi: BasisFunction, c: Context) -> EffectVariable:
    """Draw an effect against the time."""
    return EffectVariable("time (min)", (c.column("t") - c.column("t").min()) / 60)


class TemperatureRise(BasisFunction, key="warmth:NUMBER", static=False, column="temperature"):
    """φ = temperature − about [K]."""

    about: float
    uncorrected = "growth with temperature"
    plot_variable = temperature_variable

    def __call__(self, c: Context) -> Array:
        """Return the difference."""
        return c.column("temperature") - self.about


class ElapsedTime(BasisFunction, key="elapsed:NUMBER", static=False, run=True, column="t"):
    """φ = time since ``about`` [s]."""

    about: float
    uncorrected = "drift with time"
    plot_variable = time_variable

    def __call__(self, c: Context) -> Array:
        """Return the time."""
        return c.column("t") - self.about


class WarmUp(BasisFunction, key="warm-up:NUMBER:NUMBER", static=False, run=True, column="t"):
    """φ = 1 − exp(−(t − start)/τ): one body that warms up to a new balance (Newton's law of cooling)."""

    start: float
    constant: float
    uncorrected = "warming up"
    plot_variable = time_variable

    def __call__(self, c: Context) -> Array:
        """Return the part of the way that is done."""
        return np.asarray(-np.expm1(-(c.column("t") - self.start) / self.constant))

    def mean(self, duration: float) -> float:
        """Return the mean of φ over so many seconds from the start."""
        share = self.constant / duration
        return float(1 + share * np.expm1(-1 / share))


@dataclass(frozen=True)
class ThermalCause:
    """Heat or time as φ, its unit, and its largest size in the run; ``kind`` names the effects."""

    kind: str
    phi: BasisFunction
    per: str
    size: float
    how: str


@register("link growth", needs="a run with temperature_degC logged while the arm warms up or cools down")
def link_growth(run: Excitation) -> Iterator[Effect]:
    """All links grow by the same share of their length with temperature."""
    if not run.varies("temperature"):
        return
    moves = _link_lengths(run, TemperatureRise(run.mean_temperature))
    parameter = Parameter("link_growth", "1/K", THERMAL_GROWTH.usual, "thermal growth of all links", moves)
    sentence = "the arm's links {grow} with temperature, by {size}"
    yield Effect("link growth", Place("arm"), (parameter,), sentence, THERMAL_GROWTH.largest, EXPANSION)


@register("thermal drift", needs="a run with temperature_degC logged while the arm warms up or cools down")
def thermal_drift(run: Excitation) -> Iterator[Effect]:
    """Joints, base and gauge that move with temperature."""
    if run.varies("temperature"):
        rise = TemperatureRise(run.mean_temperature)
        yield from _drifts(run, ThermalCause("thermal drift", rise, "K", run.largest(rise), "with temperature"))


@register("drift", needs="a longer run")
def drift(run: Excitation) -> Iterator[Effect]:
    """Joints, base and gauge that move steadily in time."""
    if run.duration > 0:
        yield from _drifts(run, ThermalCause("drift", ElapsedTime(run.middle_time), "s", run.duration, "steadily"))


@register("warm-up", needs="a longer run that starts with a cold arm")
def warm_up(run: Excitation) -> Iterator[Effect]:
    """Joints, links and base that warm up to a new balance, with a time constant that nobody knows."""
    if not run.duration > 0:
        return
    for i in run.turning:
        sentence = f"joint {i + 1}: warms up over {{inner}} and moves by {{size}}"
        yield _warm_up(run, joint_place(i), partial(_joint_warm_up, run, i), sentence, DRIFT_TURN.largest)
    sentence = "the arm's links warm up over {inner} and {grow} by {size}"
    yield _warm_up(run, Place("arm"), partial(_link_warm_up, run), sentence, 1e-3)
    sentence = "the base warms up over {inner} and moves by {size}"
    yield _warm_up(run, Place("base"), _base_warm_up, sentence, DRIFT_SHIFT.largest)


def _drifts(run: Excitation, cause: ThermalCause) -> Iterator[Effect]:
    kind, phi, how = cause.kind, cause.phi, cause.how
    for i in run.turning:
        joint = [(f"{i + 1}", f"{kind} of joint {i + 1}", transform_move(run.rotation(i), phi))]
        yield _drift(cause, joint_place(i), "rad", joint, f"joint {i + 1}: its zero drifts {how}, {{size}}")
    for place, unit, motions, sentence in (
        ("base", "m", BASE_SHIFTS, f"base and gauge drift apart {how}, {{size}}"),
        ("base tilt", "rad", BASE_TURNS, f"the base tilts {how}, {{size}}"),
    ):
        each = [(f"_base_{m.name}", f"{kind} of the base {m.words}", m.times(phi)) for m in motions]
        yield _drift(cause, Place(place), unit, each, sentence)
    if run.setup.gauge.has_zero:
        zero = [("_zero", f"{kind} of the gauge's zero", reading_move(phi))]
        yield _drift(cause, Place("gauge"), "m", zero, f"the gauge's zero drifts {how}, {{size}}")


def _drift(
    cause: ThermalCause, place: Place, unit: str, each: Sequence[tuple[str, str, tuple[ParameterMove, ...]]],
    sentence: str,
) -> Effect:  # fmt: skip
    """An effect in proportion to its cause; ``each``: end of the name, what it is, and what it moves."""
    usual, largest = (
        (DRIFT_TURN.usual, DRIFT_TURN.largest) if unit == "rad" else (DRIFT_SHIFT.usual, DRIFT_SHIFT.largest)
    )
    least = {"s": 3600.0, "K": 5.0}[cause.per]  # an hour, 5 K: of less of a cause no larger drift is believed
    most = largest / max(cause.size, least)
    prior, label = min(usual / cause.size, most / SIGMAS_OF_LARGEST), cause.kind.replace(" ", "_")
    parameters = (Parameter(f"{label}{end}", f"{unit}/{cause.per}", prior, what, moves) for end, what, moves in each)
    return Effect(cause.kind, place, tuple(parameters), sentence, most, HEISEL)


def _warm_up(
    run: Excitation, place: Place, make: Callable[[BasisFunction], list[Parameter]], sentence: str, largest: float
) -> Effect:
    # 4 * 3600.0: [s] time constant: arms are in balance after some hours; what lasts longer is a drift
    longest = min(2 * run.duration, (4 * 3600.0))
    constants = np.geomspace(min(run.duration / 50, longest / 10), longest, 12)  # time constants that are scanned
    return Effect(
        "warm-up", place, lambda constant: make(_warming_function(run, constant)), sentence, largest, HEISEL,
        ShapeParameter("time constant", "s", constants, True), role=Role.REPEATABLE,
    )  # fmt: skip


def _warming_function(run: Excitation, constant: float) -> BasisFunction:
    phi = WarmUp(run.start, constant)
    return Less(phi.mean(run.duration), phi)


def _joint_warm_up(run: Excitation, joint: int, phi: BasisFunction) -> list[Parameter]:
    moves = transform_move(run.rotation(joint), phi)
    return [Parameter(f"warm_up{joint + 1}", "rad", DRIFT_TURN.usual, f"warm-up of joint {joint + 1}", moves)]


def _link_warm_up(run: Excitation, phi: BasisFunction) -> list[Parameter]:
    return [Parameter("warm_up_links", "1", 1e-4, "growth of all links by warming up", _link_lengths(run, phi))]


def _base_warm_up(phi: BasisFunction) -> list[Parameter]:
    return [
        Parameter(f"warm_up_base_{m.name}", "m", DRIFT_SHIFT.usual, f"warm-up of the base {m.words}", m.times(phi))
        for m in BASE_SHIFTS
    ]


def _link_lengths(run: Excitation, phi: BasisFunction) -> tuple[ParameterMove, ...]:
    return tuple(ParameterMove("transform", k, Times(length, phi)) for k, length in run.lengths)
