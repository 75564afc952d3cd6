"""Effects of encoders, gears, couplings and bearings on the angle of a joint."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np

from planner.common.units import TURN, Array, to_deg
from planner.effects.basis import BasisFunction, EffectVariable
from planner.effects.catalogue import Background, Excitation, register
from planner.effects.compliance import LEAST_LOAD, WeightTorque, twist_moves
from planner.effects.context import Context
from planner.effects.effect import Effect, Parameter, Role, ShapeParameter, joint_place, transform_move
from planner.effects.sizes import GEAR_WAVE, LARGEST_COUPLING

OF_GEARS = Background.NAMED_ONLY  # the posterior has harmonics and a band of ripple for every gear
GROWING = Background.NAMED_ONLY  # hardly any arm has it, and its errors grow beyond the angles measured
WAVES: tuple[Literal["sin", "cos"], ...] = ("sin", "cos")
TIMES = ((1.0, "once"), (2.0, "twice"), (3.0, "three times"))  # a turn, in words
SLAMANI = "Slamani, Nubiola & Bonev 2012, Industrial Robot 39(1): positioning errors of a serial robot, 0.1 mm waves"
STRAIN = "Ghorbel, Gandhi & Alpeter 2001, J. Mech. Design 123(1): strain-wave gears err twice a turn of the motor"
SPRINGS = "Herder 2001, Energy-free Systems, TU Delft: torque of a spring over a pivot by the sine; odds estimated"
NUBIOLA = "Nubiola & Bonev 2013, RCIM 29(1): coupling of wrist joints"


class JointWave(BasisFunction, key="(sin|cos):JOINT:NUMBER"):
    """φ = sin or cos(f·q) of a joint's angle q as read; f waves in one turn of the joint, any number."""

    wave: Literal["sin", "cos"]
    joint: int
    frequency: float

    def __call__(self, c: Context) -> Array:
        """Return the wave."""
        return np.asarray((np.sin if self.wave == "sin" else np.cos)(self.frequency * c.samples.q[:, self.joint]))

    def plot_variable(self, c: Context) -> EffectVariable:
        """Draw against the joint's angle, folded where it covers more than one wave."""
        q, period = to_deg(c.samples.q[:, self.joint]), 360.0 / self.frequency
        if np.ptp(q) < 1.5 * period:
            return EffectVariable(f"joint {self.joint + 1} (deg)", q)
        return EffectVariable(f"joint {self.joint + 1}, folded at {period:.4g} deg (deg)", q, period)


class BoundedWave(JointWave, key="bounded-(sin|cos):JOINT:NUMBER:NUMBER:NUMBER"):
    """The same of an angle kept between two others [rad]: beyond what was measured a curve stays as at its edge."""

    lowest: float
    highest: float

    def __call__(self, c: Context) -> Array:
        """Return the wave."""
        q = np.clip(c.samples.q[:, self.joint], self.lowest, self.highest)
        return np.asarray((np.sin if self.wave == "sin" else np.cos)(self.frequency * q))


class JointAngle(BasisFunction, key="angle:JOINT:NUMBER"):
    """φ = q − about [rad] of a joint as read: a wrong ratio, or the coupling of another joint to this one."""

    joint: int
    about: float

    def __call__(self, c: Context) -> Array:
        """Return the angle."""
        return np.asarray(c.samples.q[:, self.joint] - self.about)

    def plot_variable(self, c: Context) -> EffectVariable:
        """Draw against the joint's angle."""
        return EffectVariable(f"joint {self.joint + 1} (deg)", to_deg(c.samples.q[:, self.joint]))


@register("encoder once a turn", "encoder twice a turn", background=OF_GEARS)
def encoder_eccentricity(run: Excitation) -> Iterator[Effect]:
    """Encoder out of centre (once a turn) or out of round (twice a turn)."""
    for i in run.moving_joints:
        for (often, word), cause in zip(TIMES, ("out of centre", "out of round or tilted"), strict=False):
            sentence = f"joint {i + 1}: encoder or gear {cause}, an error {word} a turn, {{size}}"
            yield _wave(run, f"encoder {word} a turn", i, often, sentence, SLAMANI, Role.GEAR_WAVE)


@register(
    "balancing spring", needs="no run tells it from an encoder out of centre: look at the spring", background=OF_GEARS
)
def balancing_spring(run: Excitation) -> Iterator[Effect]:
    """A spring or gas cylinder that balances the arm is set wrongly: its torque winds the gear by the angle's sine.

    It holds up the joint that a weight at the flange turns most.
    """
    payload, flange = run.setup.robot.payload, run.setup.robot.n_joints
    torque = {i: run.largest(WeightTorque(i, flange)) for i in run.moving_joints}
    lifted = [i for i in sorted(torque, key=lambda i: -torque[i]) if torque[i] > LEAST_LOAD]
    # 20: [kg] payload, below which arms hold themselves up by their motors alone
    for i in lifted[:1] if payload is None or payload >= 20 else ():
        sentence = f"joint {i + 1}: a spring that balances the arm is set wrongly, an error once a turn, {{size}}"
        effect = _wave(run, "balancing spring", i, 1.0, sentence, SPRINGS, Role.UNTRACED | Role.SAME_LAW)
        # 1/4: for every joint with an encoder or gear out of centre: half of such arms have a spring, and its setting
        # is looked at when the arm is serviced
        yield replace(effect, odds=1 / 4)


@register("strain-wave error", "motor-side error")
def stated_gear_ripple(run: Excitation) -> Iterator[Effect]:
    """Gear errors whose number a turn follows from the gear ratio that the robot's file states."""
    for i in run.moving_joints:
        ratio = run.setup.robot.gear_ratio[i]
        if ratio is None:
            continue
        for often, kind, cause in (
            (2.0 * ratio, "strain-wave error", "strain-wave gear errs twice a turn of its wave generator"),
            (1.0 * ratio, "motor-side error", "motor, its encoder or the gear's input runs out once a turn"),
        ):
            sentence = f"joint {i + 1}: {cause} ({often:g} times a turn of the joint), {{size}}"
            yield _wave(run, kind, i, often, sentence, STRAIN)


@register("gear ripple", background=OF_GEARS)
def gear_ripple(run: Excitation) -> Iterator[Effect]:
    """Gear error at any number of waves a turn."""
    most = 400.0  # waves in a turn of the joint that are scanned
    for i in run.moving_joints:
        ratio = run.setup.robot.gear_ratio[i]
        highest = most if ratio is None else max(most, 2.2 * ratio)
        # 2.5: waves in a turn of the joint, the lowest that is scanned
        # 0.25: of a wave over the range of the joint between neighbours of the scan
        grid = np.arange(2.5, highest, 0.25 * TURN / float(np.ptp(run.samples.q[:, i])))
        sentence = f"joint {i + 1}: gear runs out {{inner}} times a turn, {{size}}"
        frequency = ShapeParameter("frequency", "1/turn", grid)
        yield _wave(run, "gear ripple", i, frequency, sentence, SLAMANI, Role.GEAR_WAVE | Role.REPEATABLE)


@register("reduction ratio", background=GROWING)
def reduction_ratio(run: Excitation) -> Iterator[Effect]:
    """A reduction ratio that is not what the controller thinks."""
    for i in run.moving_joints:
        sentence = f"joint {i + 1}: reduction ratio is off, {{size}} of the joint's travel"
        yield _proportional_error(run, "reduction ratio", i, i, sentence, "estimated")


@register("coupling", background=GROWING)
def coupling(run: Excitation) -> Iterator[Effect]:
    """A joint that another one's drive moves along; neighbours first, as in wrists and behind parallelograms."""
    pairs = [(i, k) for i in run.turning for k in run.moving_joints if i != k]
    for i, k in sorted(pairs, key=lambda p: (abs(p[0] - p[1]), p)):
        sentence = f"joint {i + 1}: joint {k + 1} drives it along, {{size}} of that joint's travel"
        yield _proportional_error(run, "coupling", i, k, sentence, NUBIOLA)


@register(*(f"axis wobble {word} a turn" for _, word in TIMES), background=Background.BY_PLACE)
def axis_wobble(run: Excitation) -> Iterator[Effect]:
    """A joint's axis wobbles as it turns: its bearing runs out, or is squeezed out of round."""
    for i in run.moving_joints:
        turn = run.setup.chain.transforms[run.rotation(i)].axis
        for often, word in TIMES:
            kind = f"axis wobble {word} a turn"
            tilts = tuple(
                Parameter(
                    f"wobble{i + 1}_{often:.0f}_{'xyz'[axis]}_{wave}", "rad", GEAR_WAVE.usual,
                    f"{kind} about {'xyz'[axis]}, joint {i + 1}",
                    twist_moves(i + 1, axis, JointWave(wave, i, often)),
                )
                for axis in range(3) if axis != turn for wave in WAVES
            )  # fmt: skip
            sentence = f"joint {i + 1}: bearing lets the axis wobble {word} a turn, {{size}}"
            yield Effect(kind, joint_place(i), tilts, sentence, GEAR_WAVE.largest, "estimated")


def _wave(
    run: Excitation, kind: str, joint: int, frequency: float | ShapeParameter, sentence: str, literature: str,
    role: Role = Role.ORDINARY,
) -> Effect:  # fmt: skip
    """A wave over the joint's angle, with a frequency that is known or scanned."""
    make = partial(_wave_parameters, run, kind, joint)
    place = joint_place(joint)
    if isinstance(frequency, ShapeParameter):
        return Effect(kind, place, make, sentence, GEAR_WAVE.largest, literature, frequency, role=role)
    return Effect(kind, place, make(frequency), sentence, GEAR_WAVE.largest, literature, role=role)


def _wave_parameters(run: Excitation, kind: str, joint: int, frequency: float) -> tuple[Parameter, ...]:
    label = f"{kind.replace(' ', '_').replace('-', '_')}{joint + 1}_{frequency:.8g}"
    what = f"{kind} of joint {joint + 1}, {frequency:.8g} a turn"
    return tuple(
        Parameter(f"{label}_{wave}", "rad", GEAR_WAVE.usual, f"{what}, {word}",
                  transform_move(run.rotation(joint), JointWave(wave, joint, frequency)))
        for wave, word in zip(WAVES, ("sine", "cosine"), strict=True)
    )  # fmt: skip


def _proportional_error(run: Excitation, kind: str, joint: int, driver: int, sentence: str, literature: str) -> Effect:
    """An error of a joint's angle in proportion to its own or another joint's travel."""
    place = joint_place(joint, driver)
    mean = round(float(run.samples.q[:, driver].mean()), 4)
    name = f"{kind.replace(' ', '_')}{joint + 1}" + (f"_by{driver + 1}" if driver != joint else "")
    moves = transform_move(run.rotation(joint), JointAngle(driver, mean))
    parameter = Parameter(name, "rad/rad", 5e-4, f"{kind} of {place}", moves)
    return Effect(kind, place, (parameter,), sentence, LARGEST_COUPLING, literature)
