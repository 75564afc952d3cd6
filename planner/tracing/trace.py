"""``trace()``: from the residual of the fitted geometry to its causes, one stage for each effect."""

import numpy as np

from planner.catalogue import catalogue
from planner.identification import Bench, Finding, Traced
from planner.identification.stages import Fitted
from planner.tracing.again import plain
from planner.tracing.hunt import Say
from planner.tracing.judging import own_gains, wald_log_p
from planner.tracing.limits import limits
from planner.tracing.memory import inflation, quick_memory
from planner.tracing.rivals import rivals
from planner.tracing.screen import Shade
from planner.tracing.search import Trace, search
from planner.tracing.sentence import sized
from planner.tracing.state import Held, State

HIDDEN = ("link mass",)  # shows through joints that yield only, and is fitted along with them


def trace(geometry: Fitted, bench: Bench, say: Say) -> tuple[list[Fitted], Traced]:
    """Trace what the geometry leaves, and the effects that stand beside it; return the stages that came, and findings.

    A kind of effect that is in the model already is not looked for again.
    """
    offered = catalogue(geometry.fit.model.rig, bench.run.samples)
    there = {*HIDDEN, *geometry.stage.effects}
    entries = tuple(e for e in offered if e.kind not in there)
    start = State(geometry.fit.model, (), geometry)
    found = search(start, entries, bench, say)
    last = found.last
    shade = Shade.of(last.fit, quick_memory(last, bench.run.continuous))
    say("rivals")
    gains = own_gains(last, bench)
    findings = tuple(
        _finding(found, h, own.fall, rivals(shade, last, h, found.dictionary))
        for h, own in zip(last.effects, gains, strict=True)
    )
    say("detection limits")
    taken = last.names
    silent = tuple(limits(shade, [e for e in entries if e.name not in taken], found.tried))
    return [s.fitted for s in found.path[1:]], Traced(findings, silent, found.rejected, found.tried)


def _finding(found: Trace, held: Held, gain: float, others: tuple[str, ...]) -> Finding:
    last = found.last
    which = last.positions(held)
    root = last.fit.solution.root(last.fit.problem.prior)[which]
    sizes = last.fit.errors[which]
    wide = inflation(last, held)
    value = float(np.linalg.norm(sizes))
    # of the effect as a whole, its shape held: how the parameters share what the geometry can take up too is not size
    std = value * np.sqrt(wide / max(float(sizes @ np.linalg.solve(root @ root.T, sizes)), 1e-300))
    signed = value if len(which) > 1 else float(sizes[0])
    inner = held.entry.inner
    name = held.slope_name
    spread = None
    if name in last.fit.model.names:
        row = last.fit.solution.root(last.fit.problem.prior)[last.fit.model.names.index(name)]
        spread = float(np.linalg.norm(row) * np.sqrt(wide))
    unit = held.entry.make(held.inner)[0].unit
    return Finding(
        effect=plain(held.entry.kind),
        on=held.entry.on,
        value=signed,
        std=std,
        unit=unit,
        inner_name=inner.name if inner else None,
        inner=held.inner,
        inner_std=spread,
        inner_unit=inner.unit if inner else None,
        log_p=wald_log_p(last, held, found.tried, wide),
        held_out_gain=gain,
        rivals=others,
        note=sized(held.entry, signed, std, unit, held.inner, spread, sizes),
    )
