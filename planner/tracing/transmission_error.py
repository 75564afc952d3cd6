"""The whole error of a joint's gear over its angle, where single waves do not tell it.

A gear whose error is no pure tone shows as ripple after ripple. It is one effect: the joint's angle is off by a smooth
function of itself. How quickly it changes, and how large it is, the run decides.

Where every joint of an arm errs over its own angle, each error is small beside the sum of the others: no wave of one
joint is surer than chance, and what is named first is what happens to resemble the sum. All curves together explain it.
The run decides by its likelihood, and each curve must then hold for itself against the model without it.
"""

from collections.abc import Sequence

import numpy as np

from planner.common.units import Array
from planner.effects.effect import Effect, Role
from planner.effects.gears import JointWave
from planner.effects.nonparametric import gear_curve
from planner.tracing.assumptions import FAINT_WAVE_SHARE, LEAST_CURVE_EVIDENCE, LEAST_GAIN, QUICKNESSES
from planner.tracing.effect_scores import ScoreTest
from planner.tracing.search_context import SearchContext
from planner.tracing.significance import LOG_SIGNIFICANCE, held_out_gain, own_gains
from planner.tracing.state import FittedEffect, SearchState


def likeliest_curve(test: ScoreTest, joint: int) -> Effect:
    """The curve of a joint whose quickness the screened samples are likeliest under, any size being possible."""
    setup, q = test.problem.model.setup, test.problem.samples.q
    return max((gear_curve(setup, q, joint, f) for f in QUICKNESSES), key=lambda e: _log_likelihood(test, e))


def _log_likelihood(test: ScoreTest, curve: Effect) -> float:
    """Logarithm of the likelihood of the screened samples with a curve over that without, at its likeliest size."""
    size_factors = np.array([0.3, 1.0, 3.0])  # times the expected one that are tried
    score = test.score_one(curve)
    mu, axes = np.linalg.eigh(score.information / test.noise)
    mu, along, s2 = np.maximum(mu, 0.0), axes.T @ score.along / test.noise, size_factors[:, None] ** 2
    return float(((along**2 / (mu + 1 / s2)).sum(axis=1) - np.log1p(s2 * mu).sum(axis=1)).max() / 2)


def effects_beside_curve(effects: tuple[FittedEffect, ...], wave: Effect) -> tuple[FittedEffect, ...] | None:
    """Effects that stay when a joint's waves give way to its curve; ``None`` where there is no cause for a curve.

    ``wave`` would come next. There is cause where the joint has waves already, or where another joint of the arm has a
    curve.
    """
    if not wave.has(Role.GEAR_WAVE):
        return None
    own = [f for f in effects if f.has(Role.GEAR_WAVE | Role.GEAR_CURVE) and f.effect.place == wave.place]
    if not own and not any(f.has(Role.GEAR_CURVE) for f in effects):
        return None
    return tuple(f for f in effects if f not in own)


def dominant_waves(curve: FittedEffect, sizes: Array) -> list[float]:
    """Waves a turn at which a curve is strongest, the strongest first, one for each peak."""
    power = sizes[0::2] ** 2 + sizes[1::2] ** 2
    phis = [p.main_move.phi for p in curve.parameters[0::2]]
    waves = [phi.frequency for phi in phis if isinstance(phi, JointWave)]
    padded = np.r_[0.0, power, 0.0]
    peaks = np.flatnonzero((power >= padded[:-2]) & (power > padded[2:]))
    best = sorted(peaks, key=lambda k: -power[k])[:3]  # waves of a curve
    return [waves[k] for k in best if power[k] > FAINT_WAVE_SHARE * power.max()]


def all_gear_curves(context: SearchContext, end: SearchState, compliant: SearchState | None) -> SearchState | None:
    """Return a state with the curves of all joints; ``None`` where the run is no likelier so than at ``end``.

    They join what the search has found or, where that is likelier, all compliances of joints and nothing else.
    """
    joints = sorted({j for e in context.effects if e.has(Role.GEAR_WAVE) and (j := e.place.joint) is not None})
    test = context.score_test(end)
    bare = _joints_without_curve(end, joints)
    if sum(max(0.0, _log_likelihood(test, likeliest_curve(test, j))) for j in bare) < LEAST_CURVE_EVIDENCE:
        return None
    context.report("trying all gears at once")
    begin = [end] if compliant is None else [end, compliant]
    trials = [t for b in begin if (t := _with_curves(context, b, joints)) is not None]
    if not trials:
        return None
    best = _refine_quickness(context, context.choose_likeliest(trials, at=end))
    if context.evidence_fall(end, best) < 2 * (np.log(context.tried_number) - LOG_SIGNIFICANCE):
        return None  # together they must be as sure as a single effect
    best = _drop_needless_curves(context, best)
    if len(_curves(best)) <= len(_curves(end)):
        return None
    fall, error = held_out_gain(end, best, context.fit_context)
    return best if fall > max(error, LEAST_GAIN) else None


def _curves(state: SearchState) -> list[FittedEffect]:
    return [f for f in state.effects if f.has(Role.GEAR_CURVE)]


def _joints_without_curve(state: SearchState, joints: Sequence[int]) -> list[int]:
    return [j for j in joints if j not in {f.effect.place.joint for f in _curves(state)}]


def _with_curves(context: SearchContext, state: SearchState, joints: Sequence[int]) -> SearchState | None:
    """Return a state with a curve for every joint that has none, in the place of its waves, all of one quickness."""
    bare = _joints_without_curve(state, joints)
    if not bare:
        return None
    kept = [f for f in state.effects if not (f.has(Role.GEAR_WAVE) and f.effect.place.joint in bare)]
    q, best = state.fit.problem.samples.q, None
    for quickness in QUICKNESSES:
        curves = [FittedEffect(gear_curve(state.base.setup, q, j, quickness)) for j in bare]
        trial = context.try_refit(state, (*kept, *curves))
        if trial is not None and best is not None and context.evidence_fall(best, trial, at=state) < 0:
            break  # the quicker, the less likely
        best = trial or best
    return best


def _refine_quickness(context: SearchContext, state: SearchState) -> SearchState:
    """Choose the waves of each curve again with all others in the model; keep them where the run becomes likelier."""

    def reselect(f: FittedEffect) -> FittedEffect:
        """Return the curve with the waves that are likeliest beside everything else."""
        joint = f.effect.place.joint
        if not f.has(Role.GEAR_CURVE) or joint is None:
            return f
        return FittedEffect(likeliest_curve(context.score_test_without(state, f), joint))

    again = context.try_refit(state, tuple(reselect(f) for f in state.effects))
    return state if again is None or context.evidence_fall(state, again) < 0 else again


def _drop_needless_curves(context: SearchContext, state: SearchState) -> SearchState:
    """Take out curves without which held-out samples lose nothing that matters, the least first."""
    while len(state.effects) > 1:
        own = zip(own_gains(state, context.fit_context, state.effects), state.effects, strict=True)
        margins = [(g.share - max(g.error, LEAST_GAIN), f.name, f) for g, f in own if f.has(Role.GEAR_CURVE)]
        if not margins or (least := min(margins, key=lambda m: m[:2]))[0] > 0:
            break
        state = state.refit(context.fit_context, state.without(least[2]))
    return state
