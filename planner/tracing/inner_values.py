"""Other values of a finding's inner number: frequencies between which poses that lie in lumps hardly decide."""

from collections.abc import Iterator

import numpy as np

from planner.effects.steps import SLIP
from planner.inference.posterior_background import EffectFamily, is_left_to_background, variant_family
from planner.tracing.effect_scores import ScoreTest
from planner.tracing.search_context import SearchContext
from planner.tracing.state import FittedEffect, SearchState


def other_values(bare: ScoreTest, found: FittedEffect) -> list[float]:
    """Return other values of an effect's inner number with which the run is nearly as likely, the likeliest first.

    Each is the likeliest of its surroundings. ``bare`` is the model without the effect; the likelihood is linearised.
    """
    nonlinear = found.effect.nonlinear
    if nonlinear is None or found.value is None:
        return []
    grid = nonlinear.values
    gains = bare.score(bare.lay_out([(found.effect, float(v)) for v in grid])).gain
    by_value = np.argsort(grid)
    around = np.pad(gains[by_value], 1, constant_values=-np.inf)
    peaks = by_value[(around[1:-1] >= around[:-2]) & (around[1:-1] > around[2:])]
    # 3: spacings of the grid within which the fitted value and its own uncertainty stand for all
    peaks = peaks[np.abs(grid[peaks] - found.value) > 3 * nonlinear.spacings(grid[peaks])]
    # 10: [log likelihood] by which a value may fall behind the fitted one: the draws decide down to there
    likely = peaks[gains[peaks] > bare.score_one(found.effect, found.value).gain - 2 * 10.0 * bare.noise]
    # 4: values that the draws look at besides the fitted one
    best = likely[np.argsort(-gains[likely].round(6), kind="stable")][:4]
    return [bare.refine_value(found.effect, float(grid[k])) for k in best]


def _other_values(context: SearchContext, state: SearchState) -> Iterator[tuple[FittedEffect, list[float]]]:
    """Yield each effect with other values of its inner number, where it is the only one of its kind and place.

    Waves of one gear share a family: another value of one alone would be a further wave.
    """
    families = [f.effect.family for f in state.effects]
    for found in state.effects:
        if found.value is not None and families.count(found.effect.family) == 1:
            yield found, other_values(context.score_test_without(state, found), found)


def choose_values(context: SearchContext, state: SearchState) -> SearchState:
    """Return the state with each inner number at the likeliest of its values, as far as a refit says so."""
    for found, values in list(_other_values(context, state)):
        for value in values[:1]:
            context.report(f"trying {found.name} at another value")
            effects = tuple(FittedEffect(f.effect, value) if f.name == found.name else f for f in state.effects)
            trial = context.try_refit(state, effects)
            if trial is not None and context.evidence_fall(state, trial) > 0:
                state = context.settle(state, trial)
    return state


def variants(context: SearchContext, state: SearchState) -> Iterator[EffectFamily]:
    """Yield each finding that enters the robot at other values of its inner number."""
    for found, values in _other_values(context, state):
        if found.effect.kind != SLIP and not is_left_to_background(found.effect.family):
            yield from (variant_family(found.effect.family, v, found.effect.make(v)) for v in values)
