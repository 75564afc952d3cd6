"""All gears that run unevenly at once, where no single one of them shows.

Where every joint of an arm errs over its own angle, each error is small beside the sum of the others: no wave of one
joint is surer than chance, and what is named first is what happens to resemble the sum. All curves together explain it.
The run decides by its likelihood, and each curve must then hold for itself against the model without it.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from planner.effects.effect import Effect
from planner.effects.nonparametric import gear_curve
from planner.tracing.gear_curve import GEAR_CURVE_KIND, QUICKNESSES, WAVE_KINDS, curve_log_likelihood, likeliest_curve
from planner.tracing.rivals import without_effect
from planner.tracing.score_test import ScoreTest
from planner.tracing.search_steps import SearchContext, try_refit
from planner.tracing.significance import LEAST_GAIN, LOG_SIGNIFICANCE, held_out_gain, own_gains
from planner.tracing.state import FittedEffect, SearchState, base_kind, refit

# logarithm of the likelihood that curves would add to where the search ended, below which there is no cause
LEAST_LOG_LIKELIHOOD = 3.0


def all_gear_curves(
    hunt: SearchContext, entries: Sequence[Effect], end: SearchState, yielding: SearchState | None
) -> SearchState | None:
    """Return a state with the curves of all joints; ``None`` where the run is no likelier so than at ``end``.

    They join what the search has found or, where that is likelier, all joints that yield and nothing else.
    """
    joints = sorted({int(e.on.split()[-1]) - 1 for e in entries if e.kind == WAVE_KINDS[0]})
    bare = _joints_without_curve(end, joints)
    shade = hunt.shade(end)
    if (
        sum(max(0.0, curve_log_likelihood(shade, likeliest_curve(shade, end.base, j))) for j in bare)
        < LEAST_LOG_LIKELIHOOD
    ):
        return None
    hunt.say("trying all gears at once")
    begin = [end] if yielding is None else [end, yielding]
    trials = [t for b in begin if (t := _refit_with_curves(hunt, b, joints)) is not None]
    if not trials:
        return None
    worth = hunt.memory(end)
    best = _refine_quickness(hunt, min(trials, key=lambda t: t.evidence(worth)))
    if best.evidence(worth) > end.evidence(worth) - 2 * (np.log(hunt.tried) - LOG_SIGNIFICANCE):
        return None  # together they must be as sure as a single effect
    best = _drop_needless_curves(hunt, best)
    if _count_curves(best) <= _count_curves(end):
        return None
    fall, error = held_out_gain(end, best, hunt.bench)
    return best if fall > max(error, LEAST_GAIN) else None


def _count_curves(state: SearchState) -> int:
    return sum(h.entry.kind == GEAR_CURVE_KIND for h in state.effects)


def _joints_without_curve(state: SearchState, joints: Sequence[int]) -> list[int]:
    has = {h.entry.on for h in state.effects if h.entry.kind == GEAR_CURVE_KIND}
    return [j for j in joints if f"joint {j + 1}" not in has]


def _refit_with_curves(hunt: SearchContext, state: SearchState, joints: Sequence[int]) -> SearchState | None:
    """Return a state with a curve for every joint that has none, in the place of its waves, all of one quickness."""
    bare = _joints_without_curve(state, joints)
    if not bare:
        return None
    on = {f"joint {j + 1}" for j in bare}
    kept = [h for h in state.effects if base_kind(h.entry.kind) not in WAVE_KINDS or h.entry.on not in on]
    q, worth, best = state.fit.problem.samples.q, hunt.memory(state), None
    for quickest in QUICKNESSES:
        effects = (*kept, *(FittedEffect(gear_curve(state.base.setup, q, j, quickest), None) for j in bare))
        trial = try_refit(partial(refit, hunt.bench, effects[-1].entry.name, state.base, effects, state))
        if trial is not None and best is not None and trial.evidence(worth) > best.evidence(worth):
            break  # the quicker, the less likely
        best = trial or best
    return best


def _refine_quickness(hunt: SearchContext, state: SearchState) -> SearchState:
    """How quick each curve is, seen again beside the others; kept where the run is likelier so."""
    shade = hunt.shade(state)
    effects = tuple(_reselect_curve(shade, state, h) for h in state.effects)
    again = try_refit(lambda: refit(hunt.bench, effects[-1].entry.name, state.base, effects, state))
    worth = hunt.memory(state)
    return state if again is None or again.evidence(worth) > state.evidence(worth) else again


def _reselect_curve(shade: ScoreTest, state: SearchState, held: FittedEffect) -> FittedEffect:
    if held.entry.kind != GEAR_CURVE_KIND:
        return held
    return FittedEffect(
        likeliest_curve(without_effect(shade, state, held), state.base, int(held.entry.on.split()[-1]) - 1), None
    )


def _drop_needless_curves(hunt: SearchContext, state: SearchState) -> SearchState:
    """Take out curves without which held-out samples lose nothing that matters, the least first."""
    while len(state.effects) > 1:
        own = zip(state.effects, own_gains(state, hunt.bench), strict=True)
        worth = [(g.share - max(g.error, LEAST_GAIN), h.entry.name) for h, g in own if h.entry.kind == GEAR_CURVE_KIND]
        least, name = min(worth, default=(1.0, ""))
        if least > 0:
            break
        rest = tuple(h for h in state.effects if h.entry.name != name)
        state = refit(hunt.bench, rest[-1].entry.name, state.base, rest, state)
    return state
