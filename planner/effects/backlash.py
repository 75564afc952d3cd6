"""Effects of how a joint came to where it stands: backlash, hysteresis, angles read before it settled, servo lag."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from planner.common.units import Array, to_deg
from planner.effects.basis import BasisFunction, EffectVariable
from planner.effects.catalogue import CONTINUOUS_RUN, Background, Excitation, register
from planner.effects.compliance import LoadTorque
from planner.effects.context import Context
from planner.effects.effect import (
    Effect,
    Parameter,
    ParameterMove,
    Place,
    Role,
    ShapeParameter,
    joint_place,
)
from planner.effects.sizes import BACKLASH, LAG, PLAY_OF_SCATTER, SETTLING, EffectSize


class SpeedSign(BasisFunction, key="speed-sign:JOINT", static=False, column="speed"):
    """φ = ±½ by the sign of a joint's speed."""

    joint: int
    plot_label = "joint JOINT: moving from above (−1) or below (+1)"
    plot_factor = 2.0
    uncorrected = "what depends on the sense of motion"

    def __call__(self, c: Context) -> Array:
        """Return half the sign."""
        return np.asarray(0.5 * np.sign(c.column("speed")[:, self.joint]))


class ApproachDirection(BasisFunction, key="approach:JOINT", static=False, column="direction"):
    """φ = ±½ by the side from which a joint was last approached."""

    joint: int
    plot_label = "joint JOINT: approached from above (−1) or below (+1)"
    plot_factor = 2.0
    uncorrected = "play"

    def __call__(self, c: Context) -> Array:
        """Return half the direction."""
        return np.asarray(0.5 * c.column("direction")[:, self.joint])


class TorqueSign(BasisFunction, key="torque-sign:JOINT", loads=True):
    """φ = ±½ by the sign of the load torque about a joint: the side on which the teeth lie."""

    joint: int

    def __call__(self, c: Context) -> Array:
        """Return half the sign."""
        return np.asarray(0.5 * np.sign(c.load_torque[:, self.joint]))

    def plot_variable(self, c: Context) -> EffectVariable | None:
        """Draw against the torque."""
        return LoadTorque(self.joint).plot_variable(c)


class Hysteresis(BasisFunction, key="hysteresis:JOINT:NUMBER", static=False, column="reversals"):
    """φ = −½ … ½: friction on a spring goes from one side to the other over ``width`` [rad] of travel.

    The play operator (Visintin 1994, Differential Models of Hysteresis, ch. III), run from each sample's last few
    reversals (n, N, M) [rad], the latest last, to where the joint stands.
    """

    joint: int
    width: float
    plot_label = "joint JOINT: side of its play (−½ … ½)"
    uncorrected = "hysteresis"

    def __call__(self, c: Context) -> Array:
        """Return the state of the spring."""
        turned = np.asarray(c.samples.reversals)[:, self.joint]
        way = np.diff(np.column_stack([turned, c.samples.q[:, self.joint]]), axis=1)
        state = np.zeros(len(way))
        for step in way.T:
            state = np.clip(state + step / self.width, -0.5, 0.5)
        return state


class SpeedLag(BasisFunction, key="behind:JOINT", static=False, column="speed"):
    """φ = −speed [rad/s] of a joint: the arm stands where it was read a lag ago, sense of the kinematic row."""

    joint: int
    plot_label = "speed of joint JOINT (deg/s)"
    plot_factor = float(-to_deg(1.0))
    uncorrected = "lag behind the command"

    def __call__(self, c: Context) -> Array:
        """Return minus the speed."""
        return np.asarray(-c.column("speed") @ c.setup.robot.coupling_matrix[self.joint])


class SettlingError(BasisFunction, key="unsettled:JOINT", static=False, column="q_cmd"):
    """φ = commanded − read angle [rad] of a joint, sense of the kinematic row."""

    joint: int
    plot_label = "joint JOINT: commanded less read (deg)"
    plot_factor = float(to_deg(1.0))
    uncorrected = "standing elsewhere than commanded"

    def __call__(self, c: Context) -> Array:
        """Return the difference."""
        return np.asarray((c.column("q_cmd") - c.column("q_read")) @ c.setup.robot.coupling_matrix[self.joint])


def _play(run: Excitation) -> EffectSize:
    """Return the play to be expected: an arm that repeats badly has much."""
    factor = max(1.0, PLAY_OF_SCATTER * run.setup.joint_sigma / BACKLASH.usual)
    return replace(BACKLASH, usual=factor * BACKLASH.usual, largest=factor * BACKLASH.largest)


@register("backlash", needs="poses come to from both sides of the joint")
def backlash(run: Excitation) -> Iterator[Effect]:
    """Play, by the side from which a joint comes to the pose: the sign of its speed, or of its last approach."""
    if not (run.has("speed") or run.has("direction")):
        return
    phi = SpeedSign if run.has("speed") else ApproachDirection
    seen = [i for i in run.moving_joints if np.ptp(run.values(phi(i))) > 0.5]
    for i in seen:
        yield _of_joints(run, "backlash", i, phi, _play(run), "play of {size} between the two directions")
    if len(seen) == len(run.turning):  # of an arm whose drives are all alike
        sentence = "each joint: play of {size} between the two directions"
        yield _of_joints(run, "backlash", None, phi, _play(run), sentence)


def is_loaded_both_ways(run: Excitation, joint: int) -> bool:
    """Tell whether the samples load a joint (from 0) to both sides, one of them more than by chance."""
    sign = run.values(TorqueSign(joint))
    return bool(np.minimum((sign > 0).mean(), (sign < 0).mean()) > 0.005)


@register("backlash by load", background=Background.BY_PLACE)
def backlash_by_load(run: Excitation) -> Iterator[Effect]:
    """Play that shows by the side on which the load lies."""
    for i in run.turning:
        if is_loaded_both_ways(run, i):
            sentence = "play of {size}, on the side on which the load lies"
            effect = _of_joints(run, "backlash by load", i, TorqueSign, _play(run), sentence)
            yield replace(effect, role=Role.LIKE_ANY_COMPLIANCE)


@register("hysteresis", needs=CONTINUOUS_RUN)
def hysteresis(run: Excitation) -> Iterator[Effect]:
    """Friction on a spring: the joint turns gradually from one side of its play to the other."""
    hysteresis_widths = np.geomspace(5e-3, 1.0, 16)  # [rad] of travel after a reversal
    widths = ShapeParameter("width", "rad", hysteresis_widths, True)
    for i in run.moving_joints if run.has("reversals") else ():
        of_width = partial(_hysteresis, run, i)
        yield replace(of_width(widths.values[0]), parameters=partial(_parameters, of_width), nonlinear=widths)


def _hysteresis(run: Excitation, joint: int, width: float) -> Effect:
    sentence = "friction holds it back by {size}, and lets go over {inner} of travel"
    return _of_joints(run, "hysteresis", joint, partial(Hysteresis, width=width), _play(run), sentence)


def _parameters(effect: Callable[[float], Effect], value: float) -> tuple[Parameter, ...]:
    return effect(value).make()


@register("unsettled angle", needs="both read and commanded angles in the run (q1_deg ... and cmd1_deg ...)")
def settling(run: Excitation) -> Iterator[Effect]:
    """The arm stood between the commanded and the read angle."""
    s = run.samples
    if s.q_cmd is None or s.q_read is None:
        return
    apart = np.flatnonzero(np.abs(s.q_cmd - s.q_read).max(axis=0) > 0).tolist()
    if not apart:
        return
    sentence = "angles were read before the arm had settled: it stood {size} of the way on to the commanded ones"
    yield _of_joints(run, "unsettled angle", None, SettlingError, SETTLING, sentence)
    sentence = "was read before it had settled, {size} of the way to the commanded angle missing"
    for i in apart:
        yield _of_joints(run, "unsettled angle", i, SettlingError, SETTLING, sentence)


@register("servo lag", needs=CONTINUOUS_RUN)
def servo_lag(run: Excitation) -> Iterator[Effect]:
    """Joints that stand where they were read a moment ago."""
    if not run.varies("speed"):
        return
    sentence = "all joints: the arm runs {size} behind the angles as logged"
    yield _of_joints(run, "servo lag", None, SpeedLag, LAG, sentence)
    for i in run.moving_joints:
        yield _of_joints(run, "servo lag", i, SpeedLag, LAG, "runs {size} behind its logged angle")


def _of_joints(
    run: Excitation, kind: str, joint: int | None, phi: Callable[[int], BasisFunction], size: EffectSize, sentence: str
) -> Effect:
    """An effect of one parameter: of a joint, whose name then stands before the sentence, or of all joints alike."""
    if joint is None:
        place, joints, end = Place("all joints"), run.turning, "_all"
    else:
        place, joints, end = joint_place(joint), (joint,), f"{joint + 1}"
        sentence = f"{place}: {sentence}"
    moves = tuple(ParameterMove("transform", run.rotation(i), phi(i)) for i in joints)
    parameter = Parameter(f"{kind.replace(' ', '_')}{end}", size.unit, size.usual, f"{kind} of {place}", moves)
    return Effect(kind, place, (parameter,), sentence, size.largest, size.literature)
