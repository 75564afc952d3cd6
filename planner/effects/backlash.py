"""Effects of how a joint arrives: backlash, hysteresis, settling and servo lag."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from planner.common.units import Array
from planner.effects.basis import Phi
from planner.effects.context import Context
from planner.effects.effect import Effect, Excitation, NonlinearParameter, effect_of, with_group
from planner.effects.load_functions import TorqueSign
from planner.effects.parameters import Parameter, ParameterMove, transform_move


@dataclass(frozen=True)
class SpeedSign:
    """φ = ±½ by the sign of a joint's speed."""

    joint: int

    @property
    def key(self) -> str:
        """``speed-sign:3`` for joint 3."""
        return f"speed-sign:{self.joint + 1}"

    def __call__(self, c: Context) -> Array:
        """Return half the sign."""
        assert c.samples.speed is not None
        return np.asarray(0.5 * np.sign(c.samples.speed[:, self.joint]))


@dataclass(frozen=True)
class ApproachDirection:
    """φ = ±½ by the side from which a joint was last approached."""

    joint: int

    @property
    def key(self) -> str:
        """``approach:3`` for joint 3."""
        return f"approach:{self.joint + 1}"

    def __call__(self, c: Context) -> Array:
        """Return half the direction."""
        assert c.samples.direction is not None
        return np.asarray(0.5 * c.samples.direction[:, self.joint])


@dataclass(frozen=True)
class Hysteresis:
    """φ = −½ … ½: friction on a spring goes from one side to the other over ``width`` [rad] of travel.

    The play operator (Visintin 1994, Differential Models of Hysteresis, ch. III), run from each sample's last few
    reversals (n, N, M) [rad], the latest last, to where the joint stands.
    """

    joint: int
    width: float

    @property
    def key(self) -> str:
        """``hysteresis:3:0.1``."""
        return f"hysteresis:{self.joint + 1}:{self.width!r}"

    def __call__(self, c: Context) -> Array:
        """Return the state of the spring."""
        turned = np.asarray(getattr(c.samples, "reversals", None))[:, self.joint]
        way = np.diff(np.column_stack([turned, c.samples.q[:, self.joint]]), axis=1)
        state = np.zeros(len(way))
        for step in way.T:
            state = np.clip(state + step / self.width, -0.5, 0.5)
        return state


@dataclass(frozen=True)
class SpeedLag:
    """φ = −speed [rad/s] of a joint: the arm stands where it was read a lag ago, sense of the kinematic row."""

    joint: int

    @property
    def key(self) -> str:
        """``behind:3`` for joint 3."""
        return f"behind:{self.joint + 1}"

    def __call__(self, c: Context) -> Array:
        """Return minus the speed."""
        assert c.samples.speed is not None
        return np.asarray(-c.samples.speed @ c.setup.robot.sense_matrix[self.joint])


@dataclass(frozen=True)
class SettlingError:
    """φ = commanded − read angle [rad] of a joint, sense of the kinematic row."""

    joint: int

    @property
    def key(self) -> str:
        """``unsettled:3`` for joint 3."""
        return f"unsettled:{self.joint + 1}"

    def __call__(self, c: Context) -> Array:
        """Return the difference."""
        assert c.samples.q_cmd is not None
        assert c.samples.q_read is not None
        return np.asarray((c.samples.q_cmd - c.samples.q_read) @ c.setup.robot.sense_matrix[self.joint])


@dataclass(frozen=True)
class EffectSize:
    """Unit of an effect's size, its usual (one sigma) and largest plausible value, and where they come from."""

    unit: str
    usual: float
    largest: float
    source: str


BACKLASH_SIZE = EffectSize(
    "rad", 1e-4, 1e-2, "Slamani, Nubiola & Bonev 2012, Industrial Robot 39(5): backlash of a serial robot, 0.01-0.1 mm"
)
LAG_SIZE = EffectSize("s", 2e-3, 0.1, "estimated")
SETTLING_SIZE = EffectSize("1", 0.5, 2.0, "estimated")
HYSTERESIS_WIDTHS = np.geomspace(5e-3, 1.0, 16)  # [rad] of travel after a reversal


def backlash(site: Excitation) -> Iterator[Effect]:
    """Play that shows by the side from which a joint comes: its speed's sign, or its last approach."""
    s = site.samples
    for i in site.moving:
        if s.speed is not None:
            phi: Phi = SpeedSign(i)
            both = np.ptp(np.sign(s.speed[:, i])) > 1
        elif s.direction is not None:
            phi, both = ApproachDirection(i), np.ptp(s.direction[:, i]) > 1
        else:
            return
        if both:
            sentence = f"joint {i + 1}: play of {{size}} between the two directions"
            yield _joint_effect(site, "backlash", i, phi, BACKLASH_SIZE, sentence)


def backlash_by_load(site: Excitation) -> Iterator[Effect]:
    """Play that shows by the side on which the load lies."""
    for i in range(site.n_joints):
        sign = np.sign(site.context.load_torque[:, i])
        if np.minimum((sign > 0).mean(), (sign < 0).mean()) > 0.005:
            sentence = f"joint {i + 1}: play of {{size}}, on the side on which the load lies"
            yield _joint_effect(site, "backlash by load", i, TorqueSign(i), BACKLASH_SIZE, sentence, True)


def hysteresis(site: Excitation) -> Iterator[Effect]:
    """Friction on a spring: the joint turns gradually from one side of its play to the other."""
    if getattr(site.samples, "reversals", None) is None:
        return
    inner = NonlinearParameter("width", "rad", HYSTERESIS_WIDTHS, True)
    for i in site.moving:
        sentence = f"joint {i + 1}: friction holds it back by {{size}}, and lets go over {{inner}} of travel"
        make = partial(_hysteresis_of_joint, site, i)
        yield Effect(
            "hysteresis", f"joint {i + 1}", make, sentence, BACKLASH_SIZE.largest, BACKLASH_SIZE.source, inner, False
        )


def _hysteresis_of_joint(site: Excitation, i: int, width: float | None) -> tuple[Parameter, ...]:
    assert width is not None
    moves = transform_move(site.theta(i), Hysteresis(i, width))
    what = f"hysteresis of joint {i + 1}"
    return with_group(
        "hysteresis",
        f"joint {i + 1}",
        Parameter(f"hysteresis{i + 1}", BACKLASH_SIZE.unit, BACKLASH_SIZE.usual, what, moves),
    )


def settling(site: Excitation) -> Iterator[Effect]:
    """The arm stood between the commanded and the read angle."""
    s = site.samples
    if s.q_cmd is None or s.q_read is None:
        return
    gap = np.abs(s.q_cmd - s.q_read).max(axis=0)
    if not np.any(gap > 0):
        return
    sentence = "angles were read before the arm had settled: it stood {size} of the way on to the commanded ones"
    yield _all_joints_effect(site, "unsettled angle", SettlingError(0), SETTLING_SIZE, sentence)
    for i in np.flatnonzero(gap > 0):
        sentence = f"joint {i + 1}: was read before it had settled, {{size}} of the way to the commanded angle missing"
        yield _joint_effect(site, "unsettled angle", int(i), SettlingError(int(i)), SETTLING_SIZE, sentence)


def servo_lag(site: Excitation) -> Iterator[Effect]:
    """Joints that stand where they were read a moment ago."""
    if not site.varies("speed"):
        return
    sentence = "all joints: the arm runs {size} behind the angles as logged"
    yield _all_joints_effect(site, "servo lag", SpeedLag(0), LAG_SIZE, sentence)
    for i in site.moving:
        sentence = f"joint {i + 1}: runs {{size}} behind its logged angle"
        yield _joint_effect(site, "servo lag", i, SpeedLag(i), LAG_SIZE, sentence)


def _joint_effect(
    site: Excitation, kind: str, i: int, phi: Phi, sizes: EffectSize, sentence: str, static: bool = False
) -> Effect:
    on, label = f"joint {i + 1}", f"{kind.replace(' ', '_')}{i + 1}"
    moves = transform_move(site.theta(i), phi)
    parameter = Parameter(label, sizes.unit, sizes.usual, f"{kind} of {on}", moves)
    return effect_of(kind, on, [parameter], sentence, sizes.largest, sizes.source, static)


def _all_joints_effect(
    site: Excitation, kind: str, phi: SettlingError | SpeedLag, sizes: EffectSize, sentence: str
) -> Effect:
    moves = tuple(ParameterMove("transform", site.theta(i), replace(phi, joint=i)) for i in range(site.n_joints))
    parameter = Parameter(f"{kind.replace(' ', '_')}_all", sizes.unit, sizes.usual, f"{kind} of all joints", moves)
    return effect_of(kind, "all joints", [parameter], sentence, sizes.largest, sizes.source, False)
