"""Which effects to refit first: what they would explain, less what they explain by chance."""

from dataclasses import replace

import numpy as np

from planner.effects.effect import Role
from planner.tracing.auxiliary_parameters import MASS_PRIOR, grid_spacing, link_mass_parameters
from planner.tracing.dictionary import EffectDictionary
from planner.tracing.score_test import EffectScore, ScoreTest
from planner.tracing.state import FittedEffect, known_values, may_join

# noise variances that a parameter must explain beyond what fits by chance, about the log of a run's length
PARAMETER_COST = 7.0
# share of what an effect like compliance explains that makes plain compliance, which every arm has, the likelier cause
COMPLIANCE_SHARE = 0.95
LEAST_SEPARATION = 3  # spacings of the grid between the values of two effects of a kind at a place


def scores_beside(
    test: ScoreTest, dictionary: EffectDictionary, effects: tuple[FittedEffect, ...]
) -> list[EffectScore]:
    """Score every effect that may join others, at every value that none of them has.

    Compliances are scored beside the masses of links, as likely to be off as they are: without them a compliance whose
    torques are a tenth off would lose against effects with more freedom.
    """
    joining = {item.effect.name: may_join(item.effect, effects) for item in dictionary.items}
    scores = [s for s in test.score(dictionary) if joining[s.effect.name] and _is_distinct(s, effects)]
    return [with_link_masses(test, s) for s in scores]


def with_link_masses(test: ScoreTest, score: EffectScore) -> EffectScore:
    """Score a compliance again, beside the parts by which each mass on it may be off (ridge regression)."""
    joint = score.effect.place.joint
    if not score.effect.has(Role.COMPLIANCE) or score.gain <= 0 or joint is None or score.effect.unit != "rad/Nm":
        return score
    parameters = score.effect.make(score.value)
    size = float(score.along[0] / score.information[0, 0]) * parameters[0].prior
    masses = link_mass_parameters(test.problem.model, [(joint, size)])
    both = (*parameters, *(replace(p, prior=MASS_PRIOR) for p in masses))
    wide = test.score_one(replace(score.effect, parameters=both))
    ridge = np.diag(np.r_[0.0, np.full(len(masses), test.variance)])
    a = wide.along
    return replace(score, gain=max(score.gain, float(a @ np.linalg.lstsq(wide.information + ridge, a)[0])))


def rank_candidates(
    test: ScoreTest, dictionary: EffectDictionary, effects: tuple[FittedEffect, ...]
) -> list[EffectScore]:
    """Every effect that may join others at its best value, the likeliest first; ties in catalogue order."""
    best: dict[str, EffectScore] = {}
    for s in scores_beside(test, dictionary, effects):
        if s.effect.name not in best or s.gain > best[s.effect.name].gain:
            best[s.effect.name] = s
    tried = len(dictionary.items)
    out = [
        replace(s, log_p=test.log_p(s.gain, s.size, tried), merit=merit_of(test, s))
        for s in best.values()
        if not _explained_by_compliance(test, s, best)
    ]
    return sorted(out, key=lambda s: -s.merit)


def merit_of(test: ScoreTest, score: EffectScore) -> float:
    """Gain in noise variances less what parameters and scanned values explain by being many."""
    nonlinear = score.effect.nonlinear
    scanned = 0.0 if nonlinear is None else PARAMETER_COST + 2 * float(np.log(len(nonlinear.values)))
    scanned += 2 * float(np.log(score.effect.scanned))
    return score.gain / test.noise - PARAMETER_COST * score.size - scanned


def _is_distinct(score: EffectScore, effects: tuple[FittedEffect, ...]) -> bool:
    """Whether a nonlinear value is another one than those that effects of the same kind and place have."""
    if score.value is None:
        return True
    known = known_values(score.effect, effects)
    least = LEAST_SEPARATION * grid_spacing(score.effect, score.value) if known else 0.0
    return not known or min(abs(score.value - k) for k in known) > least


def _explained_by_compliance(test: ScoreTest, score: EffectScore, best: dict[str, EffectScore]) -> bool:
    """Whether plain compliance explains what an effect like it would: of the joints that this one moves, or of all."""
    if not score.effect.has(Role.LIKE_COMPLIANCE | Role.LIKE_ANY_COMPLIANCE):
        return False
    where = {p.main.index for p in score.effect.make()}
    compliances = [p for s in best.values() if s.effect.has(Role.COMPLIANCE) for p in s.effect.make()]
    anywhere = score.effect.has(Role.LIKE_ANY_COMPLIANCE)
    alike = tuple(p for p in compliances if anywhere or p.main.index in where)
    return bool(alike) and test.score_one(replace(score.effect, parameters=alike)).gain > COMPLIANCE_SHARE * score.gain
