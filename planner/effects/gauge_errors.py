"""Errors of the gauge itself."""

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from planner.effects.basis import Phi
from planner.effects.effect import Effect, Excitation, NonlinearParameter, effect_of, value_range, with_group
from planner.effects.gauge_functions import (
    BallOffset,
    BarLength,
    BarSag,
    BeamRefraction,
    GaugeRay,
    LengthGrowth,
    LengthLag,
    LengthPower,
    PointLag,
    RayGrowth,
    ScaleWave,
)
from planner.effects.parameters import Parameter, ParameterMove, reading_move

ESTIMATED = "estimated"
SOURCE_BAR = "Kakino, Ihara & Nakatsu 1987, CIRP Annals 36(1): errors of double ball bars, some micrometres"
SOURCE_SAG = "sag correction of surveyor's tapes (Ghilani & Wolf, Elementary Surveying, ch. 6); size estimated"
SOURCE_TRACKER = (
    "Muralikrishnan, Phillips & Sawyer 2016, Precision Engineering 44: laser trackers, some parts in a million"
)
SHORTEST_PERIOD, LONGEST_PERIOD = 5e-4, 2e-2  # [m] periods of a scale that are scanned
USUAL_PERIODS = (1e-5, 2e-5, 4e-5, 1e-4, 2e-4)  # [m] usual ones below
SCAN_STEP = 0.25  # of a wave over the range of lengths between neighbours of the scan


def length_gauge_errors(site: Excitation) -> Iterator[Effect]:
    """Scale, growth, bent scale, sag and lag of a gauge that reads lengths."""
    length = site.context.length
    about, half = round(float((length.max() + length.min()) / 2), 3), max(round(value_range(length) / 2, 3), 1e-3)
    yield _length_effect(
        "gauge scale", "1", BarLength(), 1e-4, 5e-3, "the gauge's scale is off, {size} of its length", SOURCE_BAR
    )
    for power, word in ((2, "bent"), (3, "bent like an S")):
        kind = "gauge nonlinearity" if power == 2 else "gauge cubic nonlinearity"
        sentence = f"the gauge's scale is {word}, {{size}} at the ends of its range"
        yield _length_effect(kind, "m", LengthPower(about, half, power), 2e-5, 2e-3, sentence, ESTIMATED)
    sentence = "bar or wire hangs through under its own weight, {size} at its middle length"
    yield _length_effect("gauge sag", "m", BarSag(about), 2e-5, 2e-3, sentence, SOURCE_SAG)
    if site.varies("temperature"):
        growth = LengthGrowth(site.warmth)
        yield _length_effect(
            "gauge growth", "1/K", growth, 1.2e-5, 2e-4, "the gauge grows with temperature, {size}", ESTIMATED
        )
    if site.varies("speed"):
        yield _length_effect("gauge lag", "s", LengthLag(), 2e-3, 0.2, "the gauge's clock runs {size} late", ESTIMATED)


def ball_centres(site: Excitation) -> Iterator[Effect]:
    """Balls that are not where their sockets' centres are; geometry usually takes that whole."""
    ends: tuple[tuple[Literal["fixture", "tool"], str], ...] = (("fixture", "at the fixture"), ("tool", "on the tool"))
    for end, word in ends:
        on = f"ball {word}"
        each = [
            Parameter(
                f"ball_{end}_{a}", "m", 2e-5, f"ball {word} off centre along {a}", reading_move(BallOffset(end, k))
            )
            for k, a in enumerate("xyz")
        ]
        sentence = f"the ball {word} is off its centre by {{size}}"
        yield effect_of("ball centre", on, each, sentence, 1e-3, SOURCE_BAR, False)


def scale_interpolation(site: Excitation) -> Iterator[Effect]:
    """The gauge's own scale errs with each of its periods."""
    if site.samples.length is None:
        return
    step = SCAN_STEP / max(value_range(site.context.length), 1e-3)
    often = np.arange(1 / LONGEST_PERIOD, 1 / SHORTEST_PERIOD, step)
    inner = NonlinearParameter("period", "m", np.concatenate([USUAL_PERIODS, 1 / often[::-1]]), True)
    sentence = "the gauge's scale errs by {size} with a period of {inner}"
    yield Effect("scale interpolation", "gauge", _scale_waves, sentence, 5e-4, SOURCE_BAR, inner, False)


def position_gauge_errors(site: Excitation) -> Iterator[Effect]:
    """Scale, growth, lag and bent light of a gauge that reads positions."""
    sockets = len(site.setup.p_GS) > 0
    what = "the plate's distances are" if sockets else "the tracker's scale is"
    yield _position_effect(
        "gauge scale", "1", [GaugeRay(a) for a in range(3)], 1e-5, 5e-3, f"{what} off, {{size}}", SOURCE_TRACKER
    )
    if site.varies("temperature"):
        grows = [RayGrowth(a, site.warmth) for a in range(3)]
        whose = "plate" if sockets else "tracker's scale"
        sentence = f"the {whose} grows with temperature, {{size}}"
        yield _position_effect("gauge growth", "1/K", grows, 1e-5, 2e-4, sentence, SOURCE_TRACKER)
    if site.varies("speed"):
        lags = [PointLag(a) for a in range(3)]
        yield _position_effect("gauge lag", "s", lags, 2e-3, 0.2, "the gauge's clock runs {size} late", ESTIMATED)
    if not sockets:
        bends = [BeamRefraction(a) for a in range(3)]
        sentence = "warm air bends the tracker's beam, {size}"
        yield _position_effect("refraction", "1/m", bends, 1e-6, 3e-5, sentence, SOURCE_TRACKER)


def _length_effect(kind: str, unit: str, phi: Phi, prior: float, largest: float, sentence: str, source: str) -> Effect:
    parameter = Parameter(kind.replace(" ", "_"), unit, prior, kind, reading_move(phi))
    return effect_of(kind, "gauge", [parameter], sentence, largest, source, False)


def _position_effect(
    kind: str, unit: str, phis: Sequence[Phi], prior: float, largest: float, sentence: str, source: str
) -> Effect:
    moves = tuple(ParameterMove("reading", axis, phi) for axis, phi in enumerate(phis))
    parameter = Parameter(kind.replace(" ", "_"), unit, prior, kind, moves)
    return effect_of(kind, "gauge", [parameter], sentence, largest, source, False)


def _scale_waves(period: float | None) -> tuple[Parameter, ...]:
    assert period is not None
    label, what = f"scale_{period * 1e3:.8g}mm", f"error of the scale with period {period * 1e3:.8g} mm"
    return with_group(
        "scale interpolation",
        "gauge",
        Parameter(f"{label}_sin", "m", 5e-6, f"{what}, sine", reading_move(ScaleWave("sin", period))),
        Parameter(f"{label}_cos", "m", 5e-6, f"{what}, cosine", reading_move(ScaleWave("cos", period))),
    )
