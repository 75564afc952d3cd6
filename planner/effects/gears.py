"""Effects of encoders, gears, couplings and bearings on the angle of a joint."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from planner.common.units import Array
from planner.effects.context import Context
from planner.effects.effect import (
    Effect,
    Excitation,
    NonlinearParameter,
    effect_of,
    twist_moves,
    value_range,
    with_group,
)
from planner.effects.parameters import Parameter, transform_move


@dataclass(frozen=True)
class Sine:
    """φ = sin(f·q) of a joint's angle q as read; f waves in one turn of the joint, any number."""

    joint: int
    frequency: float

    @property
    def key(self) -> str:
        """``sin:3:12.5`` for joint 3."""
        return f"sin:{self.joint + 1}:{self.frequency!r}"

    def __call__(self, c: Context) -> Array:
        """Return the sine."""
        return np.asarray(np.sin(self.frequency * c.samples.q[:, self.joint]))


@dataclass(frozen=True)
class Cosine:
    """φ = cos(f·q) of a joint's angle q as read; f waves in one turn of the joint, any number."""

    joint: int
    frequency: float

    @property
    def key(self) -> str:
        """``cos:3:12.5`` for joint 3."""
        return f"cos:{self.joint + 1}:{self.frequency!r}"

    def __call__(self, c: Context) -> Array:
        """Return the cosine."""
        return np.asarray(np.cos(self.frequency * c.samples.q[:, self.joint]))


@dataclass(frozen=True)
class Angle:
    """φ = q − about [rad] of a joint as read: a wrong ratio, or the coupling of another joint to this one."""

    joint: int
    about: float

    @property
    def key(self) -> str:
        """``angle:3:0.5`` for joint 3."""
        return f"angle:{self.joint + 1}:{self.about!r}"

    def __call__(self, c: Context) -> Array:
        """Return the angle."""
        return np.asarray(c.samples.q[:, self.joint] - self.about)


WAVE_SIZE = 1e-4  # [rad], one sigma of a wave: 20 arc seconds
LARGEST_WAVE = 5e-3  # [rad]
LOWEST_FREQUENCY, HIGHEST_FREQUENCY = 2.5, 400.0  # waves in a turn of the joint that are scanned
SCAN_STEP = 0.25  # of a wave over the range of the joint between neighbours of the scan
FULL_TURN = 2 * np.pi
SOURCE_ENCODER = (
    "Slamani, Nubiola & Bonev 2012, Industrial Robot 39(1): positioning errors of a serial robot, 0.1 mm waves"
)
SOURCE_STRAIN_WAVE = (
    "Ghorbel, Gandhi & Alpeter 2001, J. Mech. Design 123(1): strain-wave gears err twice a turn of the motor"
)


def encoder_eccentricity(site: Excitation) -> Iterator[Effect]:
    """Encoder out of centre (once a turn) or out of round (twice a turn)."""
    for i in site.moving:
        for often, word, why in ((1.0, "once", "out of centre"), (2.0, "twice", "out of round or tilted")):
            kind = f"encoder {word} a turn"
            sentence = f"joint {i + 1}: encoder or gear {why}, an error {word} a turn, {{size}}"
            make = partial(_fixed_waves, site, kind, i, often)
            yield Effect(kind, f"joint {i + 1}", make, sentence, LARGEST_WAVE, SOURCE_ENCODER)


def gear_ripple(site: Excitation) -> Iterator[Effect]:
    """Gear error at any number of waves a turn."""
    for i in site.moving:
        grid = np.arange(
            LOWEST_FREQUENCY, _highest_frequency(site, i), SCAN_STEP * FULL_TURN / value_range(site.samples.q[:, i])
        )
        sentence = f"joint {i + 1}: gear runs out {{inner}} times a turn, {{size}}"
        inner = NonlinearParameter("frequency", "1/turn", grid)
        make = partial(_scanned_waves, site, "gear ripple", i)
        yield Effect("gear ripple", f"joint {i + 1}", make, sentence, LARGEST_WAVE, SOURCE_ENCODER, inner)


def stated_gear_ripple(site: Excitation) -> Iterator[Effect]:
    """Gear errors whose number a turn follows from the gear ratio that the robot's file states."""
    for i in site.moving:
        ratio = site.setup.robot.gear_ratio[i]
        if ratio is None:
            continue
        for often, kind, why in (
            (2.0 * ratio, "strain-wave error", "strain-wave gear errs twice a turn of its wave generator"),
            (1.0 * ratio, "motor-side error", "motor, its encoder or the gear's input runs out once a turn"),
        ):
            sentence = f"joint {i + 1}: {why} ({often:g} times a turn of the joint), {{size}}"
            make = partial(_fixed_waves, site, kind, i, often)
            yield Effect(kind, f"joint {i + 1}", make, sentence, LARGEST_WAVE, SOURCE_STRAIN_WAVE)


def reduction_ratio(site: Excitation) -> Iterator[Effect]:
    """A reduction ratio that is not what the controller thinks."""
    for i in site.moving:
        sentence = f"joint {i + 1}: reduction ratio is off, {{size}} of the joint's travel"
        make = partial(_proportional_angle, site, "reduction ratio", f"joint {i + 1}", i, i)
        yield Effect("reduction ratio", f"joint {i + 1}", make, sentence, 1e-2, "estimated")


def coupling(site: Excitation) -> Iterator[Effect]:
    """A joint that another one's drive moves along; neighbours first, as in wrists and behind parallelograms."""
    pairs = [(i, k) for i in range(site.n_joints) for k in site.moving if i != k]
    for i, k in sorted(pairs, key=lambda p: (abs(p[0] - p[1]), p)):
        on = f"joint {i + 1} by joint {k + 1}"
        sentence = f"joint {i + 1}: joint {k + 1} drives it along, {{size}} of that joint's travel"
        yield Effect(
            "coupling", on, partial(_proportional_angle, site, "coupling", on, i, k), sentence, 1e-2,
            "Nubiola & Bonev 2013, RCIM 29(1): coupling of wrist joints",
        )  # fmt: skip


def axis_wobble(site: Excitation) -> Iterator[Effect]:
    """A joint's axis wobbles as it turns: its bearing runs out, or is squeezed out of round."""
    for i in site.moving:
        turn = site.setup.chain.transforms[site.theta(i)].axis
        for often, word in ((1.0, "once"), (2.0, "twice"), (3.0, "three times")):
            kind, on = f"axis wobble {word} a turn", f"joint {i + 1}"
            tilts = [
                Parameter(
                    f"wobble{i + 1}_{often:.0f}_{'xyz'[axis]}_{wave}", "rad", WAVE_SIZE,
                    f"{kind} about {'xyz'[axis]}, {on}", twist_moves(i + 1, axis, phi),
                )
                for axis in range(3) if axis != turn
                for wave, phi in (("sin", Sine(i, often)), ("cos", Cosine(i, often)))
            ]  # fmt: skip
            sentence = f"{on}: bearing lets the axis wobble {word} a turn, {{size}}"
            yield effect_of(kind, on, tilts, sentence, LARGEST_WAVE, "estimated")


def _highest_frequency(site: Excitation, joint: int) -> float:
    ratio = site.setup.robot.gear_ratio[joint]
    return HIGHEST_FREQUENCY if ratio is None else max(HIGHEST_FREQUENCY, 2.2 * ratio)


def _scanned_waves(site: Excitation, kind: str, joint: int, inner: float | None) -> tuple[Parameter, ...]:
    assert inner is not None
    return _fixed_waves(site, kind, joint, inner, None)


def _fixed_waves(site: Excitation, kind: str, joint: int, frequency: float, _: float | None) -> tuple[Parameter, ...]:
    k = site.theta(joint)
    label = f"{kind.replace(' ', '_').replace('-', '_')}{joint + 1}_{frequency:.8g}"
    what = f"{kind} of joint {joint + 1}, {frequency:.8g} a turn"
    return with_group(
        kind,
        f"joint {joint + 1}",
        Parameter(f"{label}_sin", "rad", WAVE_SIZE, f"{what}, sine", transform_move(k, Sine(joint, frequency))),
        Parameter(f"{label}_cos", "rad", WAVE_SIZE, f"{what}, cosine", transform_move(k, Cosine(joint, frequency))),
    )


def _proportional_angle(
    site: Excitation, kind: str, on: str, joint: int, by: int, _: float | None
) -> tuple[Parameter, ...]:
    mean = round(float(site.samples.q[:, by].mean()), 4)
    label = f"{kind.replace(' ', '_')}{joint + 1}" + (f"_by{by + 1}" if by != joint else "")
    moves = transform_move(site.theta(joint), Angle(by, mean))
    return with_group(kind, on, Parameter(label, "rad/rad", 5e-4, f"{kind} of {on}", moves))
