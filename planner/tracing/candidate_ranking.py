"""Which effects are likeliest to join a model, by their scores."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.effects.effect import Effect, Role
from planner.effects.sizes import LINK_MASS
from planner.tracing.assumptions import COMPLIANCE_SHARE, PARAMETER_COST
from planner.tracing.dictionary import DictionaryItem, EffectDictionary
from planner.tracing.effect_scores import EffectScore, ScoreTest
from planner.tracing.state import FittedEffect, known_values, link_mass_parameters, may_join


def scores_beside(
    test: ScoreTest, dictionary: EffectDictionary, effects: tuple[FittedEffect, ...], size_cost: float = 0.0
) -> list[EffectScore]:
    """Score every effect that may join others, at the best of the values that none of them has.

    The best explains most, less ``size_cost`` noise variances a parameter. Compliances are scored beside the masses of
    links, as likely to be off as they are: without them a compliance whose torques are a tenth off would lose against
    effects with more freedom.
    """
    scores = test.score(dictionary)
    worth = scores.gain - size_cost * test.noise * scores.size
    best = []
    for effect, part in dictionary.effects:
        if may_join(effect, effects):
            allowed = _are_distinct(effect, dictionary.items[part], effects)
            if allowed.any():
                best.append(scores[part.start + int(np.argmax(np.where(allowed, worth[part], -np.inf)))])
    return with_link_masses(test, best)


def with_link_masses(test: ScoreTest, scores: list[EffectScore]) -> list[EffectScore]:
    """Score compliances again, beside the parts by which each mass on them may be off (ridge regression)."""
    bearing = [
        s for s in scores
        if s.effect.has(Role.COMPLIANCE) and s.gain > 0 and s.effect.place.joint is not None
        and s.effect.unit == "rad/Nm"
    ]  # fmt: skip
    if not bearing:
        return scores
    wider = []
    for s in bearing:
        parameters = s.effect.make(s.value)
        size = float(s.along[0] / s.information[0, 0]) * parameters[0].prior
        masses = link_mass_parameters(test.problem.model, [(s.effect.place.joint or 0, size)])
        wider.append(replace(s.effect, parameters=(*parameters, *(replace(p, prior=LINK_MASS.usual) for p in masses))))
    gains = {}
    for s, wide in zip(bearing, test.score(test.lay_out([(e, None) for e in wider])), strict=True):
        ridge = np.diag(np.r_[0.0, np.full(len(wide.along) - 1, test.variance)])
        a = wide.along
        gains[id(s)] = max(s.gain, float(a @ np.linalg.lstsq(wide.information + ridge, a)[0]))
    return [replace(s, gain=gains[id(s)]) if id(s) in gains else s for s in scores]


def rank_candidates(
    test: ScoreTest, dictionary: EffectDictionary, effects: tuple[FittedEffect, ...]
) -> list[EffectScore]:
    """Every effect that may join others at its best value, the likeliest first; ties in catalogue order."""
    best = scores_beside(test, dictionary, effects)
    needless = _needless_beside_compliance(test, best)
    best = [s for s in best if s.effect.name not in needless]
    gain, size = np.array([s.gain for s in best]), np.array([s.size for s in best], dtype=int)
    chances = test.log_ps(gain, size, len(dictionary.items)).tolist()
    out = [replace(s, log_p=p, merit=merit_of(test, s)) for s, p in zip(best, chances, strict=True)]
    return sorted(out, key=lambda s: s.place_in_order)


def merit_of(test: ScoreTest, score: EffectScore) -> float:
    """Gain in noise variances less what parameters and scanned values explain by being many."""
    nonlinear = score.effect.nonlinear
    scanned = 0.0 if nonlinear is None else PARAMETER_COST + 2 * float(np.log(len(nonlinear.values)))
    scanned += 2 * float(np.log(score.effect.scanned))
    return score.gain / test.noise - PARAMETER_COST * score.size - scanned


def _are_distinct(effect: Effect, items: Sequence[DictionaryItem], effects: tuple[FittedEffect, ...]) -> np.ndarray:
    """Tell of each nonlinear value, (k,), whether effects of the same kind and place have another one."""
    known = known_values(effect, effects)
    if not known or effect.nonlinear is None:
        return np.ones(len(items), dtype=bool)
    values = np.array([item.value for item in items], dtype=float)
    apart = np.abs(values[:, None] - known).min(axis=1)
    # 3: spacings of the grid between the values of two effects of a kind at a place
    return np.asarray(apart > 3 * effect.nonlinear.spacings(values))


def _needless_beside_compliance(test: ScoreTest, scores: list[EffectScore]) -> set[str]:
    """Names of effects like compliance that plain compliance explains: of the joints that they move, or of all."""
    compliances = [p for s in scores if s.effect.has(Role.COMPLIANCE) for p in s.effect.make()]
    plain = list[tuple[EffectScore, Effect]]()
    for s in scores:
        if s.effect.has(Role.LIKE_COMPLIANCE | Role.LIKE_ANY_COMPLIANCE):
            where, anywhere = {p.main_move.index for p in s.effect.make()}, s.effect.has(Role.LIKE_ANY_COMPLIANCE)
            alike = tuple(p for p in compliances if anywhere or p.main_move.index in where)
            plain += [(s, replace(s.effect, parameters=alike))] if alike else []
    gains = test.score(test.lay_out([(e, None) for _, e in plain])).gain if plain else ()
    return {s.effect.name for (s, _), g in zip(plain, gains, strict=True) if g > COMPLIANCE_SHARE * s.gain}
