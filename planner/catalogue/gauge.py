"""Errors of the gauge itself."""

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from planner.catalogue.site import Site, entry, named, spread
from planner.catalogue.types import Entry, Inner
from planner.effects.basis import Phi
from planner.effects.gauge import (
    BarAlong,
    Growth,
    Length,
    LengthLag,
    LengthPower,
    PointLag,
    Ray,
    RayGrowth,
    Refraction,
    Sag,
    ScaleWave,
)
from planner.model import Move, Parameter
from planner.model.parameters import reading

ESTIMATED = "estimated"
KNAPP = "Kakino, Ihara & Nakatsu 1987, CIRP Annals 36(1): errors of double ball bars, some micrometres"
TAPE = "sag correction of surveyor's tapes (Ghilani & Wolf, Elementary Surveying, ch. 6); size estimated"
TRACKER = "Muralikrishnan, Phillips & Sawyer 2016, Precision Engineering 44: laser trackers, some parts in a million"
SHORTEST, LONGEST = 5e-4, 2e-2  # [m] periods of a scale that are scanned
GRATINGS = (1e-5, 2e-5, 4e-5, 1e-4, 2e-4)  # [m] usual ones below
WAVES = 0.25  # of a wave over the range of lengths between neighbours of the scan


def bar(site: Site) -> Iterator[Entry]:
    """Scale, growth, bent scale, sag and lag of a gauge that reads lengths."""
    if site.rig.kind != "length":
        return
    length = site.context.length
    about, half = round(float((length.max() + length.min()) / 2), 3), max(round(spread(length) / 2, 3), 1e-3)
    yield _one("gauge scale", "1", Length(), 1e-4, 5e-3, "the gauge's scale is off, {size} of its length", KNAPP)
    for power, word in ((2, "bent"), (3, "bent like an S")):
        kind = "gauge nonlinearity" if power == 2 else "gauge cubic nonlinearity"
        sentence = f"the gauge's scale is {word}, {{size}} at the ends of its range"
        yield _one(kind, "m", LengthPower(about, half, power), 2e-5, 2e-3, sentence, ESTIMATED)
    sentence = "bar or wire hangs through under its own weight, {size} at its middle length"
    yield _one("gauge sag", "m", Sag(about), 2e-5, 2e-3, sentence, TAPE)
    if site.varies("temperature"):
        growth = Growth(site.warmth)
        yield _one("gauge growth", "1/K", growth, 1.2e-5, 2e-4, "the gauge grows with temperature, {size}", ESTIMATED)
    if site.varies("speed"):
        yield _one("gauge lag", "s", LengthLag(), 2e-3, 0.2, "the gauge's clock runs {size} late", ESTIMATED)


def balls(site: Site) -> Iterator[Entry]:
    """Balls that are not where their sockets' centres are; geometry usually takes that whole."""
    if site.rig.kind != "length":
        return
    ends: tuple[tuple[Literal["fixture", "tool"], str], ...] = (("fixture", "at the fixture"), ("tool", "on the tool"))
    for end, word in ends:
        on = f"ball {word}"
        each = [
            Parameter(f"ball_{end}_{a}", "m", 2e-5, f"ball {word} off centre along {a}", reading(BarAlong(end, k)))
            for k, a in enumerate("xyz")
        ]
        sentence = f"the ball {word} is off its centre by {{size}}"
        yield entry("ball centre", on, each, sentence, 1e-3, KNAPP, False)


def interpolation(site: Site) -> Iterator[Entry]:
    """The gauge's own scale errs with each of its periods."""
    if site.rig.kind != "length" or site.samples.length is None:
        return
    step = WAVES / max(spread(site.context.length), 1e-3)
    often = np.arange(1 / LONGEST, 1 / SHORTEST, step)
    inner = Inner("period", "m", np.concatenate([GRATINGS, 1 / often[::-1]]), True)
    sentence = "the gauge's scale errs by {size} with a period of {inner}"
    yield Entry("scale interpolation", "gauge", _scale_waves, sentence, 5e-4, KNAPP, inner, False)


def frame(site: Site) -> Iterator[Entry]:
    """Scale, growth, lag and bent light of a gauge that reads positions."""
    if site.rig.kind == "length":
        return
    sockets = len(site.rig.p_GS) > 0
    what = "the plate's distances are" if sockets else "the tracker's scale is"
    yield _all_axes("gauge scale", "1", [Ray(a) for a in range(3)], 1e-5, 5e-3, f"{what} off, {{size}}", TRACKER)
    if site.varies("temperature"):
        grows = [RayGrowth(a, site.warmth) for a in range(3)]
        whose = "plate" if sockets else "tracker's scale"
        sentence = f"the {whose} grows with temperature, {{size}}"
        yield _all_axes("gauge growth", "1/K", grows, 1e-5, 2e-4, sentence, TRACKER)
    if site.varies("speed"):
        lags = [PointLag(a) for a in range(3)]
        yield _all_axes("gauge lag", "s", lags, 2e-3, 0.2, "the gauge's clock runs {size} late", ESTIMATED)
    if not sockets:
        bends = [Refraction(a) for a in range(3)]
        sentence = "warm air bends the tracker's beam, {size}"
        yield _all_axes("refraction", "1/m", bends, 1e-6, 3e-5, sentence, TRACKER)


def _one(kind: str, unit: str, phi: Phi, prior: float, largest: float, sentence: str, source: str) -> Entry:
    parameter = Parameter(kind.replace(" ", "_"), unit, prior, kind, reading(phi))
    return entry(kind, "gauge", [parameter], sentence, largest, source, False)


def _all_axes(
    kind: str, unit: str, phis: Sequence[Phi], prior: float, largest: float, sentence: str, source: str
) -> Entry:
    moves = tuple(Move("reading", axis, phi) for axis, phi in enumerate(phis))
    parameter = Parameter(kind.replace(" ", "_"), unit, prior, kind, moves)
    return entry(kind, "gauge", [parameter], sentence, largest, source, False)


def _scale_waves(period: float | None) -> tuple[Parameter, ...]:
    assert period is not None
    label, what = f"scale_{period * 1e3:.8g}mm", f"error of the scale with period {period * 1e3:.8g} mm"
    return named(
        "scale interpolation",
        "gauge",
        Parameter(f"{label}_sin", "m", 5e-6, f"{what}, sine", reading(ScaleWave("sin", period))),
        Parameter(f"{label}_cos", "m", 5e-6, f"{what}, cosine", reading(ScaleWave("cos", period))),
    )
