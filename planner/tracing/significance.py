"""Whether an effect that was added to the model is significant, with correlated noise accounted for."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.common.units import Array, mean_by_group
from planner.effects.compliance import LINK_MASSES
from planner.effects.effect import Role, implausible_text
from planner.effects.steps import SLIP
from planner.fit.covariance import correlation_time
from planner.fit.cross_validation import predict_held_out, predict_held_out_without
from planner.fit.problem import WhitenedColumns
from planner.inference.stages import FitContext, comparison_weight, error_reduction
from planner.model.identification_document import Metrics
from planner.tracing.assumptions import DETERMINED_VARIANCE
from planner.tracing.effect_scores import log_exceedance
from planner.tracing.state import FittedEffect, SearchState

LOG_SIGNIFICANCE = float(np.log(2e-3))  # chance, corrected for all that was tried, below which an effect may be added


def screening_correlation_time(state: SearchState, continuous: bool) -> float:
    """How many samples count as one where effects are screened: along a drive errors are correlated.

    By the residual's quick part: what is slow may be an effect yet to be found. Poses at rest count one each.
    """
    if not continuous:
        return 1.0
    white = state.fit.problem.weighted_residual(state.fit.errors)[:, 0]
    # 40: segments of a run whose means are taken out: a missing effect is slow
    segment = np.arange(len(white)) * 40 // len(white)
    mean = mean_by_group(white, segment)
    return correlation_time(white - mean[segment])


def variance_inflation(state: SearchState, found: FittedEffect) -> float:
    """Factor, 1 or more, on the variance of an effect's size for the autocorrelation of the noise.

    With correlations ρ of the residual and γ of the effect's own column at a lag of l samples it is 1 + 2 Σ ρ(l) γ(l)
    (Bartlett 1935). An effect that comes and goes at random from sample to sample does not mind.
    """
    return variance_inflations(state, [found])[0]


def variance_inflations(state: SearchState, effects: Sequence[FittedEffect]) -> list[float]:
    """Return the factor of each of some effects, see :func:`variance_inflation`."""
    white = state.white_columns
    noise = autocorrelation_function(white.residual)
    return [_inflation(state, noise, white.residual.size, _own_column(state, f, white)) for f in effects]


def _inflation(state: SearchState, noise: Array, readings: int, column: Array) -> float:
    shape = autocorrelation_function(column)
    faint = np.flatnonzero(noise < 2 / np.sqrt(readings))
    last = int(faint[0]) if len(faint) else len(noise)
    measured = 1 + 2 * float((noise[1:last] * shape[1:last]).sum())
    # a fit takes slow noise out of a short run's residual: its neighbours then tell how long the rest would last
    spare = 1 - min(0.5, state.fit.effective / readings)
    next_one = min(0.98, max(0.0, float(noise[1]) + 1 / np.sqrt(readings)) / spare)
    fading = next_one ** np.arange(len(shape))
    return max(1.0, measured, 1 + 2 * float((fading[1:] * shape[1:]).sum()))


def autocorrelation_function(x: Array) -> Array:
    """Correlation of the samples of x (n, r) at lags 0 to n/4, (n/4,)."""
    n = len(x)
    size = 1 << (2 * n - 1).bit_length()
    power = (np.abs(np.fft.rfft(x, size, axis=0)) ** 2).sum(axis=1)
    rho = np.fft.irfft(power)[: max(2, n // 4)]
    return np.asarray(rho / max(rho[0], 1e-300))


def _own_column(state: SearchState, found: FittedEffect, white: WhitenedColumns) -> Array:
    """What the effect adds to the whitened readings (n, r) that the other parameters cannot."""
    errors, (kept, S) = state.fit.errors / state.fit.problem.prior, state.covariance_root
    own, among = state.positions(found), np.isin(kept, state.positions(found))
    part = np.zeros(len(errors) + 1)
    part[own] = errors[own]
    # with H the information, −H⁻¹ between the others and the effect is Σ between both over the effect's own Σ
    part[kept[~among]] = S[~among] @ (S[among].T @ np.linalg.solve(S[among] @ S[among].T, errors[own]))
    return white.factored.times(part)


def rejection_reason(before: SearchState, after: SearchState, fit_context: FitContext, tried: int) -> str | None:
    """Return why the last effect of ``after`` is not kept, ``None`` if it is.

    The run must be likelier with it, its parameters averaged over, by more than the best of all that were tried would
    be by chance. A wrong row explains nothing but itself, and must be many standard deviations off.
    """
    found = after.effects[-1]
    size = float(np.linalg.norm(after.sizes(found)))
    if size > found.effect.largest:
        return implausible_text(found.effect, size)
    if found.effect.kind == SLIP:
        surely = wald_log_p(after, found, tried) <= LOG_SIGNIFICANCE
    else:
        time = screening_correlation_time(before, fit_context.run.continuous)
        least = 2.0 * (float(np.log(max(tried, found.effect.scanned))) - LOG_SIGNIFICANCE)
        surely = before.evidence(time) - after.evidence(time) > least
    return None if surely else "the run is no likelier with it than chance would have it among so many"


def held_out_gain(before: SearchState, after: SearchState, fit_context: FitContext) -> tuple[float, float]:
    """Share of the held-out squared error that goes from one state to another, and its standard error."""
    was, now = before.stage, after.stage
    return error_reduction(was.held_residual, now.held_residual, fit_context.split, comparison_weight(was, now))


@dataclass(frozen=True)
class OwnGain:
    """What one effect gains for itself: against the model without it, everything else fitted anew.

    Attributes:
        fall: of the held-out root mean square error [m].
        share: of the held-out squared error that goes with it; ``error`` its standard error.
    """

    fall: float
    share: float
    error: float


def own_gains(state: SearchState, fit_context: FitContext, effects: Sequence[FittedEffect]) -> list[OwnGain]:
    """What each of some effects in the model of a state gains; noise, prior sigmas and masses stay as they are."""
    fit, split = state.fit, fit_context.split
    parameters = fit.model.parameters
    parts = [
        [*state.positions(f), *(j for j, p in enumerate(parameters) if p.name == f.sensitivity_name)] for f in effects
    ]
    masses = [j for j, p in enumerate(parameters) if p.group == LINK_MASSES]
    after = predict_held_out(fit, split).residual
    bare = [h.residual for h in predict_held_out_without(fit, split, parts, masses)]
    weight = fit.problem.weight
    least = Metrics.of(after, weight=weight).rms
    falls = [Metrics.of(b, weight=weight).rms - least for b in bare]
    return [OwnGain(fall, *error_reduction(b, after, split, weight)) for fall, b in zip(falls, bare, strict=True)]


def wald_statistic(state: SearchState, found: FittedEffect, beside: Array | None = None) -> tuple[float, int]:
    """Return the Wald statistic of an effect per parameter (how far it is from zero), and the number of parameters.

    ``beside`` is the covariance (k, k) of its sizes that comes from what the model leaves out.

    Of a gear's curve only the parameters count that the readings decide: others stay near zero by their prior alone.
    Masses count as known, since they show only through compliances.
    """
    kept, whole = state.covariance_root
    which = np.searchsorted(kept, state.positions(found))
    root = whole[which]
    prior = state.fit.problem.prior[kept][which]
    spread = root @ root.T if beside is None else root @ root.T + beside / np.outer(prior, prior)
    variance, axes = np.linalg.eigh(spread)  # per prior sigma: 1 where the readings say nothing
    along = axes.T @ (state.fit.errors[kept][which] / prior)
    decided = variance < DETERMINED_VARIANCE
    if not found.has(Role.GEAR_CURVE) or not decided.any():
        decided = np.ones(len(which), dtype=bool)
    return float((along[decided] ** 2 / variance[decided]).mean()), int(decided.sum())


def wald_log_p(
    state: SearchState, found: FittedEffect, tried: int, inflation: float | None = None, beside: Array | None = None
) -> float:
    """Logarithm of the chance of so large an effect in the final model, corrected for everything that was tried.

    Beside other gears that run unevenly a gear's curve is one of as many as there are joints.
    """
    inflation = variance_inflation(state, found) if inflation is None else inflation
    tried = max(tried, found.effect.scanned)
    if found.has(Role.GEAR_CURVE) and sum(f.has(Role.GEAR_CURVE) for f in state.effects) > 1:
        tried = min(tried, state.base.setup.robot.n_joints)
    dof = max(1.0, len(state.fit.problem) * state.fit.model.width / inflation - state.fit.effective)
    size, directions = wald_statistic(state, found, beside)
    one = log_exceedance(np.array(size / inflation), directions, dof)
    return min(0.0, float(one) + float(np.log(tried)))
