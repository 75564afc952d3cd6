"""How well the parameters are known: the covariance of a fit, with the samples of a continuous run correlated."""

import numpy as np

from planner.identification.fit import MEDIAN, Fit
from planner.units import Array

BLOCK = 10  # correlation times in one block of a continuous run
BLOCKS = 3  # blocks for each parameter that it takes to trust their scatter
LONGEST = 20_000  # samples over which the correlation is looked for


def parameter_covariance(fit: Fit, continuous: bool) -> tuple[Array, float]:
    """Return the covariance of the parameters (P, P) and how many samples are worth one, for their correlation.

    For poses at rest it is the information's inverse, noise as estimated. Along a continuous run errors stay what they
    are from sample to sample: the scatter of the scores over blocks, each many correlation times long, replaces that
    of single samples (Liang and Zeger 1986); where the run is too short for that, the correlation time scales it all.
    """
    problem, solution = fit.problem, fit.solution
    root = solution.root(problem.prior)
    plain = root @ root.T * _robust_factor(fit)
    if not continuous:
        return plain, 1.0
    white = problem.white_residual(fit.errors)
    time = correlation_time(white[:, 0])
    size = max(1, int(np.ceil(BLOCK * time)))
    count = len(problem) // size
    if count < BLOCKS * len(fit.errors):
        return plain * time, time
    scores = _scores(fit, np.minimum(np.arange(len(problem)) // size, count - 1), count)
    bread = np.linalg.inv(solution.factor)
    inverse = bread @ bread.T  # of the information, in prior sizes
    half = inverse @ scores.T
    white_noise = half @ half.T * count / max(1.0, count - fit.effective)
    return np.asarray((white_noise + inverse @ inverse) * np.outer(problem.prior, problem.prior)), time


def _robust_factor(fit: Fit) -> float:
    """What Huber's variance is of the one that the weighted rows alone would give (Huber 1981, eq. 6.5)."""
    weight = fit.problem.weight
    if np.all(weight == 1.0):
        return 1.0
    u = fit.problem.white_residual(fit.errors)
    u = u / max(float(np.median(np.sqrt((u**2).mean(axis=1)))) / MEDIAN[u.shape[1]], 1e-300)
    psi, inside = u * weight[:, None], float((weight == 1.0).mean())
    stretch = 1 + fit.effective / u.size * (1 - inside) / inside
    stated = float((weight[:, None] * u**2).mean() / weight.mean())
    return stretch**2 * float((psi**2).mean()) / inside**2 / stated


def correlation_time(x: Array) -> float:
    """Number of samples that are worth one, 1 + 2 Σ ρ_k up to the first ρ below noise (Sokal's window)."""
    x = x[: LONGEST * 5] - x.mean()
    n = len(x)
    size = 1 << (2 * n - 1).bit_length()
    power = np.abs(np.fft.rfft(x, size)) ** 2
    rho = np.fft.irfft(power)[: min(n, LONGEST)]
    rho /= max(rho[0], 1e-300)
    total = 1 + 2 * np.cumsum(rho[1:])
    wide = np.flatnonzero(np.arange(1, len(rho)) >= 5 * np.maximum(total, 1.0))
    return float(max(1.0, total[wide[0]] if len(wide) else total[-1]))


def _scores(fit: Fit, block: np.ndarray, count: int) -> Array:
    """Sum of rowᵀ·residual over every block, (blocks, P), in prior sizes."""
    problem = fit.problem

    def one(part: slice) -> Array:
        piece = problem.piece(part, fit.errors)
        each = np.einsum("nrp,nr->np", piece.rows, piece.residual)
        out = np.zeros((count, each.shape[1]))
        np.add.at(out, block[part], each)
        return out

    return np.asarray(sum(problem.over_pieces(one)))
