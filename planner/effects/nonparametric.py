"""Effects that are smooth curves without a physical model: the error of a gear over its angle, and corrections
without a name."""

from collections.abc import Iterator

import numpy as np

from planner.cell.setup import MeasurementSetup
from planner.common.units import Array
from planner.effects.effect import Effect
from planner.effects.gears import Cosine, Sine
from planner.effects.parameters import Parameter, transform_move

GEAR_CURVE = "gear error curve"
QUICKEST_MODELLED = 2.0  # times the quickness: the quickest waves that are modelled
CURVE_SIZE = 2e-4  # [rad], root mean square
LARGEST_CURVE = 5e-3  # [rad]
PERIOD_OVER_RANGE = 1.3  # length over which the function repeats itself, over the joint's range
FULL_TURN = 2 * np.pi


def gear_curve(setup: MeasurementSetup, q: Array, joint: int, quickest: float) -> Effect:
    """Return the curve of a joint as an entry.

    Args:
        setup: the measurement set-up.
        q: controller angles whose range it covers, (n, N) [rad].
        joint: from 0.
        quickest: waves a turn within which most of the error lies.
    """
    spread = min(FULL_TURN, PERIOD_OVER_RANGE * float(np.ptp(q[:, joint])))
    step = FULL_TURN / spread
    waves = step * np.arange(1, max(2, int(QUICKEST_MODELLED * quickest / step) + 1))
    size = np.exp(-0.5 * (waves / quickest) ** 2)
    size *= CURVE_SIZE / np.sqrt((size**2).sum())
    where = next(k for k, t in enumerate(setup.chain.transforms) if t.joint == joint)
    on = f"joint {joint + 1}"
    parameters = tuple(
        Parameter(
            f"gear_curve{joint + 1}_{name}{k}", "rad", float(s), f"gear error of {on}, {w:.4g} waves a turn",
            transform_move(where, phi), f"{GEAR_CURVE}, {on}",
        )
        for k, (w, s) in enumerate(zip(waves, size, strict=True), 1)
        for name, phi in (("sin", Sine(joint, float(w))), ("cos", Cosine(joint, float(w))))
    )  # fmt: skip
    sentence = f"{on}: gear or encoder runs unevenly over the joint's own angle, {{size}}"
    return Effect(
        GEAR_CURVE, on, lambda _: parameters, sentence, LARGEST_CURVE, "measured curve: no model of a gear behind it"
    )


NONPARAMETRIC = "unnamed"
CORRECTION_WAVES = 6
CORRECTION_SIZE = 3e-4  # [rad], one sigma of the longest wave
LARGEST_CORRECTION = 1e-2  # [rad]


def nonparametric_effects(setup: MeasurementSetup, q: Array) -> Iterator[Effect]:
    """Yield corrections of each joint over its own angle, then over another joint's; q (n, N) [rad]."""
    turns = {t.joint: k for k, t in enumerate(setup.chain.transforms) if t.joint is not None}
    spread = np.ptp(q, axis=0)
    moving = [int(i) for i in np.flatnonzero(spread > 1e-2)]
    for i, by in sorted(((i, k) for i in turns for k in moving), key=lambda pair: (pair[0] != pair[1], pair)):
        yield _smooth_correction(turns[i], i, by, float(spread[by]))


def _smooth_correction(where: int, i: int, by: int, spread: float) -> Effect:
    on = f"joint {i + 1}" + ("" if i == by else f" by joint {by + 1}")
    label = f"unnamed{i + 1}" + ("" if i == by else f"_by{by + 1}")
    parameters = tuple(
        Parameter(
            f"{label}_{wave}{k}",
            "rad",
            CORRECTION_SIZE / k**2,
            f"smooth correction of {on}",
            transform_move(where, phi),
            f"{NONPARAMETRIC}, {on}",
        )
        for k in range(1, CORRECTION_WAVES + 1)
        for wave, phi in (("sin", Sine(by, k * np.pi / spread)), ("cos", Cosine(by, k * np.pi / spread)))
    )  # fmt: skip
    over = "its own angle" if i == by else f"joint {by + 1}'s angle"
    sentence = f"joint {i + 1}: moves smoothly with {over} by {{size}}, for a cause that has no name here"
    return Effect(
        NONPARAMETRIC, on, lambda _: parameters, sentence, LARGEST_CORRECTION, "none: a description, not a cause"
    )
