"""How much less a run tells of an effect because its errors remember each other from sample to sample."""

import numpy as np

from planner.identification.spread import correlation_time
from planner.tracing.masses import GROUP
from planner.tracing.state import Held, State
from planner.units import Array

STRETCHES = 40  # of a run, whose means are taken out before its memory is measured: an effect that is missing is slow


def quick_memory(state: State, continuous: bool) -> float:
    """How many samples are worth one where effects are screened: along a drive errors remember each other.

    By the residual's quick part: what is slow may be an effect yet to be found. Poses at rest are worth one each.
    """
    if not continuous:
        return 1.0
    white = state.fit.problem.white_residual(state.fit.errors)[:, 0]
    stretch = np.arange(len(white)) * STRETCHES // len(white)
    mean = np.bincount(stretch, white) / np.bincount(stretch)
    return correlation_time(white - mean[stretch])


def inflation(state: State, held: Held) -> float:
    """Factor, 1 or more, on the variance of an effect's size for the memory of the noise.

    With correlations ρ of the residual and γ of the effect's own column at a lag of l samples it is 1 + 2 Σ ρ(l) γ(l)
    (Bartlett 1935); an effect that comes and goes at random from sample to sample does not mind.
    """
    residual, column = _residual_and_column(state, held)
    noise, shape = correlations(residual), correlations(column)
    faint = np.flatnonzero(noise < 2 / np.sqrt(residual.size))
    last = int(faint[0]) if len(faint) else len(noise)
    measured = 1 + 2 * float((noise[1:last] * shape[1:last]).sum())
    # a fit takes slow noise out of a short run's residual: its neighbours then tell how long the rest would last
    spare = 1 - min(0.5, state.fit.effective / residual.size)
    next_one = min(0.98, max(0.0, float(noise[1]) + 1 / np.sqrt(residual.size)) / spare)
    fading = next_one ** np.arange(len(shape))
    return max(1.0, measured, 1 + 2 * float((fading[1:] * shape[1:]).sum()))


def correlations(x: Array) -> Array:
    """Correlation of the samples of x (n, r) at lags 0 to n/4, (n/4,)."""
    n = len(x)
    size = 1 << (2 * n - 1).bit_length()
    power = (np.abs(np.fft.rfft(x, size, axis=0)) ** 2).sum(axis=1)
    rho = np.fft.irfft(power)[: max(2, n // 4)]
    return np.asarray(rho / max(rho[0], 1e-300))


def _residual_and_column(state: State, held: Held) -> tuple[Array, Array]:
    """Whitened residual of the fit, and what the effect adds to the readings that the other parameters cannot."""
    problem, errors = state.fit.problem, state.fit.errors
    piece = problem.piece(slice(None), errors)
    P = piece.rows.shape[2]
    own = state.positions(held)
    rest = [j for j in range(P) if j not in own and state.fit.model.parameters[j].group != GROUP]
    column = piece.rows[:, :, own] @ (errors[own] / problem.prior[own])
    others = piece.rows[:, :, rest].reshape(-1, len(rest))
    gram = others.T @ others + np.eye(len(rest))
    taken = others @ np.linalg.solve(gram, others.T @ column.reshape(-1))
    return piece.residual, column - taken.reshape(column.shape)
