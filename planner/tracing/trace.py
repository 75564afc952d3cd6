"""``trace()``: from the residual of the fitted geometry to its causes, one stage for each effect."""

import numpy as np

from planner.common.units import Array
from planner.effects.catalogue import catalogue
from planner.effects.effect import Effect
from planner.identification.calibration import TracingResult
from planner.identification.stages import FitContext, FittedStage
from planner.model.identification_document import Finding, InnerNumber, log10_p, p_value
from planner.tracing.detection_limits import detection_limits
from planner.tracing.gear_curve import GEAR_CURVE_KIND as CURVE
from planner.tracing.gear_curve import dominant_waves
from planner.tracing.rivals import find_rivals
from planner.tracing.score_test import ScoreTest
from planner.tracing.search import SearchResult, search
from planner.tracing.search_steps import Progress
from planner.tracing.significance import own_gains, screening_correlation_time, variance_inflation, wald_log_p
from planner.tracing.state import FittedEffect, SearchState, base_kind

DISPLAY_UNITS = {
    "rad": ("µrad", 1e6),
    "m": ("µm", 1e6),
    "rad/Nm": ("µrad/Nm", 1e6),
    "m/N": ("µm/N", 1e6),
    "s": ("ms", 1e3),
    "1": ("µm/m", 1e6),
    "1/K": ("µm/m/K", 1e6),
    "m/K": ("µm/K", 1e6),
    "rad/K": ("µrad/K", 1e6),
    "m/s": ("µm/h", 3.6e9),
    "rad/s": ("µrad/h", 3.6e9),
    "rad/rad": ("µrad/rad", 1e6),
}
NONLINEAR_UNITS = {"1/turn": ("", 1.0), "s": ("s", 1.0), "m": ("mm", 1e3), "rad": ("µrad", 1e6)}


def describe_effect(
    entry: Effect, value: float, std: float, unit: str, inner: float | None, inner_std: float | None, sizes: Array
) -> str:
    """Fill the entry's sentence with its size, its inner number, and the periods of a curve."""
    size = format_value(abs(value), std, *DISPLAY_UNITS.get(unit, (unit, 1.0)))
    number = ""
    if inner is not None and entry.inner is not None:
        number = format_value(inner, inner_std, *NONLINEAR_UNITS.get(entry.inner.unit, (entry.inner.unit, 1.0)))
    sentence = entry.sentence.format(size=size, inner=number)
    if value < 0:  # otherwise the sign is one of axes and senses, which a mechanic does not look for
        sentence = sentence.replace(" grow ", " shrink ")
    if entry.kind == CURVE:
        *others, last = [f"{f:.0f}" for f in dominant_waves(entry.make(None), sizes)]
        sentence += f", mostly in waves of about {', '.join(others)}{' and ' if others else ''}{last} a turn"
    return sentence


def format_value(value: float, std: float | None, unit: str, factor: float) -> str:
    """``182 ± 6 µrad``: the uncertainty to two digits at most, the value no finer than that."""
    value *= factor
    if std is None or not np.isfinite(std) or std <= 0:
        return f"{value:.3g} {unit}".strip()
    std *= factor
    digits = int(np.clip(1 - np.floor(np.log10(std)), 0, 9))
    if std >= 3:
        digits = 0
    return f"{value:.{digits}f} ± {std:.{digits}f} {unit}".strip()


HIDDEN = ("link mass",)  # shows through joints that yield only, and is fitted along with them


def trace(geometry: FittedStage, bench: FitContext, say: Progress) -> tuple[list[FittedStage], TracingResult]:
    """Trace what the geometry leaves, and the effects that stand beside it; return the stages that came, and findings.

    A kind of effect that is in the model already is not looked for again.
    """
    offered = catalogue(geometry.fit.model.setup, bench.run.samples)
    there = {*HIDDEN, *geometry.stage.effects}
    entries = tuple(e for e in offered if e.kind not in there)
    start = SearchState(geometry.fit.model, (), geometry)
    found = search(start, entries, bench, say)
    last = found.last
    shade = ScoreTest.of(last.fit, screening_correlation_time(last, bench.run.continuous))
    say("rivals")
    gains = own_gains(last, bench)
    findings = tuple(
        _finding(found, h, own.fall, find_rivals(shade, last, h, found.dictionary))
        for h, own in zip(last.effects, gains, strict=True)
    )
    say("detection limits")
    taken = last.names
    silent = tuple(detection_limits(shade, [e for e in entries if e.name not in taken], found.tried))
    return [s.fitted for s in found.path[1:]], TracingResult(findings, silent, found.rejected, found.tried)


def _finding(found: SearchResult, held: FittedEffect, gain: float, others: tuple[str, ...]) -> Finding:
    last = found.last
    which = last.positions(held)
    root = last.fit.solution.root(last.fit.problem.prior)[which]
    sizes = last.fit.errors[which]
    wide = variance_inflation(last, held)
    value = float(np.linalg.norm(sizes))
    # of the effect as a whole, its shape held: how the parameters share what the geometry can take up too is not size
    std = value * np.sqrt(wide / max(float(sizes @ np.linalg.solve(root @ root.T, sizes)), 1e-300))
    signed = value if len(which) > 1 else float(sizes[0])
    inner, name, spread = None, held.slope_name, None
    if name in last.fit.model.names:
        row = last.fit.solution.root(last.fit.problem.prior)[last.fit.model.names.index(name)]
        spread = float(np.linalg.norm(row) * np.sqrt(wide))
    if held.inner is not None and (number := held.entry.inner) is not None:
        inner = InnerNumber(name=number.name, value=held.inner, std=spread, unit=number.unit)
    unit = held.entry.make(held.inner)[0].unit
    log_p = wald_log_p(last, held, found.tried, wide)
    return Finding(
        effect=base_kind(held.entry.kind),
        on=held.entry.on,
        value=signed,
        std=std,
        unit=unit,
        inner=inner,
        p_value=p_value(log_p),
        log10_p=log10_p(log_p),
        gain=gain,
        rivals=others,
        note=describe_effect(held.entry, signed, std, unit, held.inner, spread, sizes),
    )
