"""``trace()``: from the residual of the fitted geometry to its causes, one stage for each effect."""

import numpy as np

from planner.common.units import Array
from planner.effects.catalogue import catalogue
from planner.effects.effect import Role
from planner.effects.size_text import DISPLAY_UNITS, format_value
from planner.identification.calibration import TracingResult
from planner.identification.stages import FitContext, FittedStage
from planner.model.identification_document import Finding, InnerNumber, log10_p, p_value
from planner.runs.run import Run
from planner.tracing.change_text import ChangeNote, describe_change
from planner.tracing.rivals import detection_limits, find_rivals
from planner.tracing.score_test import ScoreTest
from planner.tracing.search import SearchResult, search
from planner.tracing.search_context import Progress
from planner.tracing.significance import own_gains, screening_correlation_time, variance_inflation, wald_log_p
from planner.tracing.state import FittedEffect, SearchState
from planner.tracing.transmission_error import dominant_waves

LEAST_MM = 1e-4  # [m] from which on what changed is told in millimetres
NONLINEAR_UNITS = {"1/turn": ("", 1.0), "s": ("s", 1.0), "m": ("mm", 1e3), "rad": ("µrad", 1e6)}


def trace(geometry: FittedStage, bench: FitContext, say: Progress) -> tuple[list[FittedStage], TracingResult]:
    """Trace what the geometry leaves, and the effects that stand beside it; return the stages that came, and findings.

    A kind of effect that is in the model already is not looked for again.
    """
    offered = catalogue(geometry.fit.model.setup, bench.run.samples)
    effects = [e for e in offered if not e.has(Role.UNTRACED) and e.kind not in geometry.stage.effects]
    result = search(SearchState(geometry.fit.model, (), geometry), effects, bench, say)
    last = result.last
    test = ScoreTest.of(last.fit, screening_correlation_time(last, bench.run.continuous))
    say("rivals")
    gains = own_gains(last, bench)
    findings = tuple(
        _finding(result, f, own.fall, find_rivals(test, last, f, result.dictionary, result.things), bench.run)
        for f, own in zip(last.effects, gains, strict=True)
    )
    say("detection limits")
    silent = tuple(detection_limits(test, [e for e in effects if e.name not in last.names], result.tried))
    return [s.fitted for s in result.path[1:]], TracingResult(findings, silent, result.rejected, result.tried)


def _finding(result: SearchResult, found: FittedEffect, gain: float, others: tuple[str, ...], run: Run) -> Finding:
    last, nonlinear = result.last, found.effect.nonlinear
    which = last.positions(found)
    root = last.fit.solution.root(last.fit.problem.prior)
    sizes, own = last.fit.errors[which], root[which]
    inflation = variance_inflation(last, found)
    value = float(np.linalg.norm(sizes))
    # of the effect as a whole, its shape held: how the parameters share what the geometry can take up too is not size
    std = value * np.sqrt(inflation / max(float(sizes @ np.linalg.solve(own @ own.T, sizes)), 1e-300))
    signed = value if len(which) > 1 else float(sizes[0])
    inner_std = None
    if found.sensitivity_name in last.fit.model.names:
        row = root[last.fit.model.names.index(found.sensitivity_name)]
        inner_std = float(np.linalg.norm(row) * np.sqrt(inflation))
    inner = None
    if found.value is not None and nonlinear is not None:
        inner = InnerNumber(name=nonlinear.name, value=found.value, std=inner_std, unit=nonlinear.unit)
    log_p = wald_log_p(last, found, result.tried, inflation)
    note = describe_effect(found, signed, std, inner_std, sizes)
    change = describe_change(last, found, note, run) if found.has(Role.CHANGE) else ChangeNote(note)
    return Finding(
        effect=found.effect.kind,
        on=str(found.effect.place),
        value=signed,
        std=std,
        unit=found.effect.unit,
        inner=inner,
        p_value=p_value(log_p),
        log10_p=log10_p(log_p),
        gain=gain,
        rivals=others,
        note=change.note,
        after_sample=change.after_sample,
        surely_within=change.surely_within,
        row=change.row,
    )


def describe_effect(found: FittedEffect, value: float, std: float, inner_std: float | None, sizes: Array) -> str:
    """Fill the effect's sentence with its size, its nonlinear value, and the periods of a curve."""
    effect, nonlinear = found.effect, found.effect.nonlinear
    unit = DISPLAY_UNITS.get(effect.unit, (effect.unit, 1.0))
    if effect.has(Role.CHANGE) and effect.unit == "m" and abs(value) > LEAST_MM:
        unit = ("mm", 1e3)
    size = format_value(abs(value), std, *unit)
    inner = ""
    if found.value is not None and nonlinear is not None:
        inner = format_value(found.value, inner_std, *NONLINEAR_UNITS.get(nonlinear.unit, (nonlinear.unit, 1.0)))
    sentence = effect.sentence.format(size=size, inner=inner, more="more" if value > 0 else "less")
    if value < 0:  # otherwise the sign is one of axes and senses, which a mechanic does not look for
        sentence = sentence.replace(" grow ", " shrink ")
    if found.has(Role.GEAR_CURVE):
        *others, last = [f"{f:.0f}" for f in dominant_waves(found, sizes)]
        sentence += f", mostly in waves of about {', '.join(others)}{' and ' if others else ''}{last} a turn"
    return sentence
