"""Which effects to refit first: what they would explain, less what they explain by chance."""

from dataclasses import dataclass, replace

import numpy as np

from planner.effects.effect import Effect
from planner.tracing.auxiliary_parameters import COMPLIANCE, MASS_PRIOR, grid_spacing, link_mass_parameters
from planner.tracing.dictionary import EffectDictionary, column_products
from planner.tracing.score_test import EffectScore, ScoreTest, log_p, score_effects
from planner.tracing.state import LEAST_SEPARATION, FittedEffect, known_nonlinear_values, may_join


@dataclass(frozen=True)
class CandidateEffect:
    """An entry of the catalogue at one value of its inner number, and what it would explain.

    Attributes:
        entry, inner: which.
        gain: fall of the whitened sum of squares by its parameters, after the model has taken what it can.
        size: number of its parameters that the readings show.
        log_p: logarithm of the chance of so large a gain, corrected for everything that was tried.
        score: gain in noise variances less what parameters and inner numbers explain by being many.
    """

    entry: Effect
    inner: float | None
    gain: float
    size: int
    log_p: float
    score: float


def with_link_masses(shade: ScoreTest, scores: list[EffectScore]) -> list[EffectScore]:
    """Return the scores, those of the joints' compliances with the weights as likely to be off as they are."""
    return [_score_with_link_masses(shade, s) if s.entry.kind == COMPLIANCE and s.gain > 0 else s for s in scores]


def _score_with_link_masses(shade: ScoreTest, plain: EffectScore) -> EffectScore:
    """Score a compliance again, beside the parts by which each weight on it may be off (ridge regression)."""
    parameters = plain.entry.make(None)
    first, model = parameters[0], shade.problem.model
    joint = model.setup.chain.transforms[first.main.index].joint
    if len(parameters) > 1 or joint is None:
        return plain
    size = float(plain.along[0] / plain.information[0, 0]) * first.prior
    both = (*parameters, *(replace(p, prior=MASS_PRIOR) for p in link_mass_parameters(model, [(joint, size)])))
    entry = replace(plain.entry, make=lambda _: both)
    dictionary = shade.lay_out([(entry, None)])
    done = column_products(dictionary, shade.problem, shade.errors, shade.basis, shade.residual)
    hold = np.r_[0.0, np.full(len(both) - 1, shade.variance)]
    G, a = done.squares[0] - done.shadow.T @ done.shadow + np.diag(hold), done.along
    return replace(plain, gain=max(plain.gain, float(a @ np.linalg.lstsq(G, a)[0])))


# noise variances that a parameter must explain beyond what fits by chance, about the log of a run's length
PARAMETER_COST = 7.0
# what joints that merely give way are easily taken for
PAYLOAD_MASS, BACKLASH_BY_LOAD = "payload mass", "backlash by load"
# share of what these explain that makes plain compliance, which every arm has, the likelier cause
COMPLIANCE_SHARE = 0.95


def rank_candidates(
    shade: ScoreTest, dictionary: EffectDictionary, effects: tuple[FittedEffect, ...]
) -> list[CandidateEffect]:
    """Every entry that may join ``effects`` at its best inner value, the likeliest first; ties in catalogue order."""
    scores = [s for s in score_effects(shade, dictionary) if may_join(s.entry, effects) and is_distinct(s, effects)]
    scores = with_link_masses(shade, scores)
    best: dict[str, EffectScore] = {}
    for s in scores:
        if s.entry.name not in best or s.gain > best[s.entry.name].gain:
            best[s.entry.name] = s
    unlikely = (s for s in best.values() if s.entry.kind in (PAYLOAD_MASS, BACKLASH_BY_LOAD))
    doubted = frozenset(s.entry.name for s in unlikely if _explained_by_compliance(shade, s, best))
    tried = len(dictionary.items)
    variance = shade.variance / shade.worth
    out = [
        CandidateEffect(
            s.entry, s.inner, s.gain, s.size, log_p(shade, s.gain, s.size, tried), penalised_score(s, variance)
        )
        for s in best.values()
        if s.entry.name not in doubted
    ]
    return sorted(out, key=lambda c: -c.score)


def penalised_score(scored: EffectScore, variance: float) -> float:
    """Gain in noise variances less what parameters and scanned inner numbers explain by being many."""
    inner = scored.entry.inner
    return (
        scored.gain / variance
        - PARAMETER_COST * scored.size
        - (0.0 if inner is None else PARAMETER_COST + 2 * np.log(len(inner.values)))
    )


def is_distinct(scored: EffectScore, effects: tuple[FittedEffect, ...]) -> bool:
    """Whether an inner number is another one than those that effects of the same entry have."""
    if scored.inner is None or not effects:
        return True
    known = known_nonlinear_values(scored.entry, effects)
    if not known:
        return True
    return min(abs(scored.inner - k) for k in known) > LEAST_SEPARATION * grid_spacing(scored.entry, scored.inner)


def _explained_by_compliance(shade: ScoreTest, mass: EffectScore, best: dict[str, EffectScore]) -> bool:
    """Whether plain compliance explains as much: of the joints at which a wrong mass would show, of all for play."""
    where = {p.main.index for p in mass.entry.make(None)}
    soft = [s.entry for s in best.values() if s.entry.kind == "joint compliance"]
    anywhere = mass.entry.kind == BACKLASH_BY_LOAD
    parts = tuple(p for e in soft for p in e.make(None) if anywhere or p.main.index in where)
    if not parts:
        return False
    both = replace(mass.entry, make=lambda _: parts)
    return score_effects(shade, shade.lay_out([(both, None)]))[0].gain > COMPLIANCE_SHARE * mass.gain
