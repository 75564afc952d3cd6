"""What a run cannot tell apart, and what it would have shown: rivals of a finding, and detection limits."""

from collections.abc import Iterator, Sequence
from functools import cache

import numpy as np

from planner.effects.effect import Effect
from planner.model.identification_document import DetectionLimit
from planner.tracing.change_points import best_steps
from planner.tracing.ranking import scores_beside, with_link_masses
from planner.tracing.score_test import LEAST_SHARE, EffectScore, ScoreTest
from planner.tracing.search_context import SearchContext
from planner.tracing.significance import LEAST_GAIN, LOG_SIGNIFICANCE
from planner.tracing.state import FittedEffect, SearchState

RIVAL_MARGIN = 9.2  # fall of minus twice the log likelihood that tells two causes apart: a hundred to one
RIVAL_SHARE = 0.98  # of a finding's gain that makes another a rival however sure the run is: no model is that exact
POWER = 0.95  # of the detection limit
POWER_QUANTILE = 1.645  # standard deviations by which the share of the error must be above what is worth a name
SIZE_COST = 2.0  # noise variances that a parameter explains by chance
VALUES_TRIED = 7  # of a nonlinear parameter, over its grid


def find_rivals(context: SearchContext, state: SearchState, found: FittedEffect) -> tuple[str, ...]:
    """Names of the effects that would explain what a finding explains, within uncertainty, the likeliest first.

    Steps, each at its best sample, are among them.
    """
    test, bare = context.score_test(state), context.score_test_without(state, found)
    rest = tuple(f for f in state.effects if f.name != found.name)

    def merit(score: EffectScore) -> float:  # more parameters explain more by chance alone
        return score.gain / test.noise - SIZE_COST * score.size - 2 * float(np.log(score.effect.scanned))

    own = with_link_masses(bare, [bare.score_one(found.effect, found.value)])[0]
    best: dict[str, float] = {}
    steps = best_steps(bare, context.things) if test.problem.samples.number is not None else ()
    for s in (*scores_beside(bare, context.dictionary, rest, SIZE_COST), *steps):
        if s.effect.name != found.effect.family:
            best[s.effect.name] = max(best.get(s.effect.name, -np.inf), merit(s))
    least = max(0.0, min(merit(own) - RIVAL_MARGIN, RIVAL_SHARE * own.gain / test.noise))
    return tuple(name for name, value in sorted(best.items(), key=lambda pair: -pair[1]) if value > least)


def detection_limits(test: ScoreTest, effects: Sequence[Effect], tried: int) -> Iterator[DetectionLimit]:
    """Yield the detection limit of every effect that the readings show at all, at the worst phase and value."""
    least = (np.sqrt(LEAST_GAIN * test.dof) + POWER_QUANTILE) ** 2
    worst: dict[str, float] = {}
    for s in test.score(test.lay_out([(e, v) for e in effects for v in _sample_values(e)])):
        prior = np.array([p.prior for p in s.effect.make(s.value)])
        mu = np.linalg.eigvalsh(s.information / np.outer(prior, prior))  # per unit of size
        seen = mu[mu > LEAST_SHARE * mu[-1]] if mu[-1] > 0 else mu[:0]
        size = np.inf
        if len(seen):
            needed = max(least, _noncentrality(len(seen), tried))
            size = float(np.sqrt(needed * test.scatter / test.dof / seen[0]))
        worst[s.effect.name] = max(worst.get(s.effect.name, 0.0), size)
    for e in effects:
        if worst.get(e.name, np.inf) <= e.largest:  # beyond that no arm has it: the run says nothing of it
            yield DetectionLimit(effect=e.kind, on=str(e.place), size=worst[e.name], unit=e.unit)


def _sample_values(effect: Effect) -> list[float | None]:
    """A few nonlinear values over the grid."""
    grid = effect.grid
    return [grid[k] for k in np.unique(np.linspace(0, len(grid) - 1, VALUES_TRIED).astype(int))]


@cache
def _noncentrality(size: int, tried: int) -> float:
    """Noncentrality at which a test of ``size`` parameters at the search's level has its power."""
    from scipy.optimize import brentq
    from scipy.stats import chi2, ncx2  # costs most of a second

    needed = float(chi2.isf(np.exp(LOG_SIGNIFICANCE) / tried, size))
    return float(brentq(lambda nc: ncx2.sf(needed, size, nc) - POWER, 1e-3, 10 * needed + 100))
