"""Smooth functions of a joint's angle without a physical model, which the search makes from what a run leaves.

The whole error of a gear over its angle: its waves are expected the smaller the quicker they run (a Gaussian process
with a squared exponential kernel, in its Fourier series; Rasmussen & Williams 2006, ch. 4). And, for structure that no
other effect explains, the turn of a joint as a smooth function of any joint's angle: waves of half a period over its
range and its multiples, the smaller the shorter they are, as of a smoothing spline (Wahba 1990). How smooth it is the
run decides, as the sizes of all parameters of an effect share a factor that is fitted.
"""

from collections.abc import Iterator

import numpy as np

from planner.cell.cell import MeasurementSetup
from planner.common.units import TURN, Array
from planner.effects.catalogue import Excitation, register
from planner.effects.effect import Effect, Parameter, Role, joint_place, transform_move
from planner.effects.gears import WAVES, BoundedWave
from planner.effects.sizes import GEAR_CURVE_SIZE, SMOOTH_CORRECTION

GEAR_CURVE, NONPARAMETRIC = "gear error curve", "unnamed"


@register(GEAR_CURVE, needs="nothing that can be planned: a whole curve takes the shape of whatever the readings hold")
@register(NONPARAMETRIC, needs="nothing that can be planned: the correction has no cause that could be compared")
def no_laws_beforehand(run: Excitation) -> Iterator[Effect]:
    """Yield nothing: the search itself makes these effects."""
    yield from ()


def gear_curve(setup: MeasurementSetup, q: Array, joint: int, quickest: float) -> Effect:
    """Return the whole error of a joint's gear.

    Args:
        setup: the measurement set-up.
        q: controller angles whose range it covers, (n, N) [rad].
        joint: from 0.
        quickest: waves a turn within which most of the error lies.
    """
    # 1.3: length over which the curve repeats itself, over the joint's range
    step = TURN / min(TURN, 1.3 * float(np.ptp(q[:, joint])))
    # 2.0: times the quickness: the quickest waves of a curve
    frequencies = step * np.arange(1, max(2, int(2.0 * quickest / step) + 1))
    # less the first one's exponent: of a joint that hardly moves every wave is far beyond the quickest
    size = np.exp(-0.5 * (frequencies**2 - frequencies[0] ** 2) / quickest**2)
    size *= GEAR_CURVE_SIZE.usual / np.sqrt((size**2).sum())
    rotation, ends = int(setup.chain.joint_places[joint]), _ends(q[:, joint])
    parameters = tuple(
        Parameter(
            f"gear_curve{joint + 1}_{wave}{k}", "rad", float(s),
            f"gear error of joint {joint + 1}, {f:.4g} waves a turn",
            transform_move(rotation, BoundedWave(wave, joint, float(f), *ends)),
        )
        for k, (f, s) in enumerate(zip(frequencies, size, strict=True), 1) for wave in WAVES
    )  # fmt: skip
    sentence = f"joint {joint + 1}: gear or encoder runs unevenly over the joint's own angle, {{size}}"
    literature = "measured curve: no model of a gear behind it"
    return Effect(
        GEAR_CURVE, joint_place(joint), parameters, sentence, GEAR_CURVE_SIZE.largest, literature, role=Role.GEAR_CURVE
    )


def nonparametric_effects(setup: MeasurementSetup, q: Array) -> Iterator[Effect]:
    """Yield corrections of each joint over its own angle, then over another joint's; q (n, N) [rad]."""
    rotations, ranges = setup.chain.joint_places.tolist(), np.ptp(q, axis=0)
    moving = [int(i) for i in np.flatnonzero(ranges > 1e-2)]
    pairs = ((i, by) for i in range(len(rotations)) for by in moving)
    for i, by in sorted(pairs, key=lambda pair: (pair[0] != pair[1], pair)):
        yield _correction(rotations[i], i, by, float(ranges[by]), _ends(q[:, by]))


def _ends(angle: Array) -> tuple[float, float]:
    return float(angle.min()), float(angle.max())


def _correction(rotation: int, i: int, by: int, angle_range: float, ends: tuple[float, float]) -> Effect:
    place = joint_place(i, by)
    label = f"unnamed{i + 1}" + ("" if i == by else f"_by{by + 1}")
    parameters = tuple(
        Parameter(
            f"{label}_{wave}{k}", "rad", SMOOTH_CORRECTION.usual / k**2, f"smooth correction of {place}",
            transform_move(rotation, BoundedWave(wave, by, k * np.pi / angle_range, *ends)),
        )
        for k in range(1, 6 + 1) for wave in WAVES  # waves
    )  # fmt: skip
    over = "its own angle" if i == by else f"joint {by + 1}'s angle"
    low, high = np.rad2deg(ends)
    sentence = (
        f"joint {i + 1}: moves smoothly with {over} by {{size}}, for a cause that has no name here; "
        f"known from {low:.0f} to {high:.0f} deg, beyond which it stays as there"
    )
    literature = "none: a description, not a cause"
    role = Role.NONPARAMETRIC
    return Effect(NONPARAMETRIC, place, parameters, sentence, SMOOTH_CORRECTION.largest, literature, role=role)
