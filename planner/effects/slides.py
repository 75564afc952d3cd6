"""Effects of joints that slide: scale, straightness, tilt of the carriage, play, and yielding along the way.

The direction of a slide and its zero are geometry. What is left of a guide's six errors (ISO 230-1: one of position,
two of straightness, three of angle) are smooth functions of the travel.
"""

from collections.abc import Iterator

import numpy as np

from planner.common.errors import InputError
from planner.common.units import MM, Array
from planner.effects.backlash import ApproachDirection, SpeedSign
from planner.effects.basis import BasisFunction, EffectVariable, legendre
from planner.effects.catalogue import Background, Excitation, register
from planner.effects.compliance import LoadTorque, twist_moves
from planner.effects.context import Context
from planner.effects.effect import Effect, Parameter, ParameterMove, Role, joint_place, transform_move
from planner.effects.sizes import CARRIAGE_TILT, GUIDE, GUIDE_BOW, SLIDE_PLAY, SLIDE_SCALE, SLIDE_YIELD


class OfTravel(BasisFunction):
    """A function of the travel of the joint ``joint``, which slides."""

    joint: int

    def plot_variable(self, c: Context) -> EffectVariable:
        """Draw against the travel."""
        return EffectVariable(f"joint {self.joint + 1} (mm)", c.theta[:, self.joint] / MM)


class SlideTravel(OfTravel, key="travel:JOINT:NUMBER"):
    """φ = travel − about [m] of a joint that slides: a scale that is wrong."""

    about: float

    def __call__(self, c: Context) -> Array:
        """Return the travel."""
        return np.asarray(c.theta[:, self.joint] - self.about)


class GuideShape(OfTravel, key="guide:JOINT:INDEX:NUMBER:NUMBER"):
    """φ = Legendre's polynomial of a degree in the travel between two places [m], beyond which it stays as there."""

    degree: int
    lowest: float
    highest: float

    def __post_init__(self) -> None:
        """Refuse a travel of no length."""
        if not self.lowest < self.highest:
            raise InputError(f"the basis function '{self.key}' has a travel that ends before it begins")

    def __call__(self, c: Context) -> Array:
        """Return the polynomial."""
        middle, half = (self.lowest + self.highest) / 2, (self.highest - self.lowest) / 2
        return legendre(self.degree, (c.theta[:, self.joint] - middle) / half)


class StationShift(BasisFunction, key="shift:STATION:AXIS:AXIS:PHI"):
    """φ = one of the three numbers by which a shift along a station's axis moves the whole arm as seen at its base."""

    station: int
    axis: int
    part: int
    by: BasisFunction

    def __call__(self, c: Context) -> Array:
        """Return the number."""
        return np.asarray(c.stations.R[self.station, self.part, self.axis] * self.by(c))


def shift_moves(station: int, axis: int, by: BasisFunction) -> tuple[ParameterMove, ...]:
    """Shift everything beyond a station along one of its axes, which need not be a transform of its own."""
    return tuple(ParameterMove("transform", part, StationShift(station, axis, part, by)) for part in range(3))


@register("slide scale", background=Background.BY_PLACE)
def slide_scale(run: Excitation) -> Iterator[Effect]:
    """A rack, a screw or a belt whose pitch is not what the controller thinks."""
    for i in run.moving_slides:
        mean = round(float(run.context.theta[:, i].mean()), 4)
        moves = transform_move(run.rotation(i), SlideTravel(i, mean))
        parameter = Parameter(f"scale{i + 1}", SLIDE_SCALE.unit, SLIDE_SCALE.usual, f"scale of joint {i + 1}", moves)
        sentence = f"joint {i + 1}: its scale is off, {{size}} of its travel"
        yield Effect("slide scale", joint_place(i), (parameter,), sentence, SLIDE_SCALE.largest, SLIDE_SCALE.literature)


@register("guide straightness", "carriage tilt", background=Background.BY_PLACE)
def guide_errors(run: Excitation) -> Iterator[Effect]:
    """A guide that is bowed or wavy, and a carriage that tips or turns along it.

    Both are Legendre's polynomials of the travel, of degree 2 and 3, and 1 and 2: a straight line across is direction.
    """
    for i in run.moving_slides:
        slide = run.setup.chain.transforms[run.rotation(i)].axis
        ends = tuple(round(float(v), 4) for v in np.quantile(run.context.theta[:, i], (0.0, 1.0)))
        bows = tuple(
            Parameter(f"bow{i + 1}_{'xyz'[axis]}{n}", GUIDE_BOW.unit, GUIDE_BOW.usual / n,
                      f"straightness of joint {i + 1}",
                      shift_moves(i + 1, axis, GuideShape(i, n, *ends)))
            for axis in range(3) if axis != slide for n in (2, 3)
        )  # fmt: skip
        tilts = tuple(
            Parameter(f"carriage{i + 1}_{'xyz'[axis]}{n}", CARRIAGE_TILT.unit, CARRIAGE_TILT.usual / n,
                      f"carriage tilt of joint {i + 1}",
                      twist_moves(i + 1, axis, GuideShape(i, n, *ends)))
            for axis in range(3) for n in (1, 2)
        )  # fmt: skip
        sentence = f"joint {i + 1}: its guide is not straight, {{size}}"
        yield Effect("guide straightness", joint_place(i), bows, sentence, GUIDE_BOW.largest, GUIDE_BOW.literature)
        sentence = f"joint {i + 1}: its carriage tilts along the guide, {{size}}"
        yield Effect("carriage tilt", joint_place(i), tilts, sentence, CARRIAGE_TILT.largest, CARRIAGE_TILT.literature)


@register("slide play", needs="poses come to from both sides of the joint")
def slide_play(run: Excitation) -> Iterator[Effect]:
    """Play of the drive, by the side from which the carriage comes."""
    if not (run.has("speed") or run.has("direction")):
        return
    phi = SpeedSign if run.has("speed") else ApproachDirection
    for i in (i for i in run.moving_slides if np.ptp(run.values(phi(i))) > 0.5):
        moves = transform_move(run.rotation(i), phi(i))
        parameter = Parameter(f"slide_play{i + 1}", SLIDE_PLAY.unit, SLIDE_PLAY.usual, f"play of joint {i + 1}", moves)
        sentence = f"joint {i + 1}: play of {{size}} between the two directions"
        yield Effect("slide play", joint_place(i), (parameter,), sentence, SLIDE_PLAY.largest, SLIDE_PLAY.literature)


@register("slide compliance", background=Background.BY_PLACE)
def slide_compliance(run: Excitation) -> Iterator[Effect]:
    """A drive that gives way along its guide, under the force of weights and gauge."""
    for i in run.moving_slides:
        load = run.values(LoadTorque(i))
        size = float(np.abs(load).max())
        if size < 1e-3 or float(np.ptp(load)) < 1e-3 * size:  # [N] there is none, or it does not vary
            continue
        moves = transform_move(run.rotation(i), LoadTorque(i))
        parameter = Parameter(
            f"slide_compliance{i + 1}", "m/N", SLIDE_YIELD.usual / size, f"yielding of joint {i + 1}", moves
        )
        sentence = f"joint {i + 1}: gives way along its guide under load, {{size}}"
        largest = SLIDE_YIELD.largest / size
        yield Effect("slide compliance", joint_place(i), (parameter,), sentence, largest, GUIDE, role=Role.COMPLIANCE)
