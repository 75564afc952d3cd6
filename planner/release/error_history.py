"""How the expected error fell reading by reading, and which poses were worth most, by the posterior of the whole run.

With the sizes of all errors as the run has taught them, a reading's information is the outer product of its whitened
row R. Of K = I + R Rᵀ = L Lᵀ, and M a root of the tool's mean square error, the first k readings leave
|M|² − Σ_{i≤k} |(L⁻¹ R M)_i|². Without the pose of rows b the mean square error would be larger by
tr((K⁻¹_bb)⁻¹ X_b X_bᵀ), X = K⁻¹ R M (Woodbury).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from planner.common.units import Array
from planner.release.released_robot import ReleasedRobot
from planner.runs.run import Samples


@dataclass(frozen=True)
class ErrorHistory:
    """The expected error of the tool while a run was measured.

    Attributes:
        error: after the first 1 … n samples, (n,) [m], on the scale of what is stated.
        worth: how much larger the mean square error would be without each sample, as a part of it, (n,).
        minutes: from the first sample, (n,); ``None`` where no clock was logged.
    """

    error: Array
    worth: Array
    minutes: Array | None


def error_history(released: ReleasedRobot, samples: Samples) -> ErrorHistory | None:
    """Return the history of a run of poses at rest; ``None`` of a long run."""
    known = released.posterior
    problem = known.fit.problem
    # 2000: numbers of a run whose history is worked out: a longer one was read on the way
    if len(problem) * problem.model.width > 2000:
        return None
    rows = problem.white_columns(known.fit.errors).rows
    n, width, _ = rows.shape
    size = np.sqrt((known.mixture.scaled_sizes**2).mean(axis=0))
    white = rows.reshape(n * width, -1) * size
    root = _tool_root(released) * size[:, None]
    shared, seen = _shared_root(white), white @ root
    told = solve_triangular(shared, seen, lower=True)
    whole = (root**2).sum()
    square = whole - np.cumsum((told**2).sum(axis=1).reshape(n, width).sum(axis=1))
    square = np.maximum(square, len(white) * np.finfo(float).eps * whole) + released.beside_square  # but for rounding
    inverse = solve_triangular(shared, np.eye(len(white)), lower=True)
    left = solve_triangular(shared, told, lower=True, trans=1).reshape(n, width, -1)
    blocks = (inverse.T @ inverse).reshape(n, width, n, width)[np.arange(n), :, np.arange(n)]
    worth = np.einsum("nia,nij,nja->n", left, np.linalg.inv(blocks), left)
    scale = released.anywhere / max(float(np.sqrt(square[-1])), 1e-300)
    return ErrorHistory(scale * np.sqrt(square), worth / max(float(square[-1]), 1e-300), _minutes(samples))


def _shared_root(white: Array) -> Array:
    """Return L (m, m), lower triangular, of 1 + R Rᵀ = L Lᵀ for whitened rows R (m, P).

    By [1 R] = L Qᵀ: readings that are far finer than the priors would leave 1 + R Rᵀ itself without a root.
    """
    tall = np.vstack([np.eye(len(white)), white.T])
    return np.asarray(np.linalg.qr(tall, mode="r")).T


def _tool_root(released: ReleasedRobot) -> Array:
    """Return a root (P, r) of the tool's mean square error per squared parameters in their prior sigmas [m²]."""
    fit, tool = released.posterior.fit, released.tool
    here = {name: k for k, name in enumerate(fit.model.names)}
    at = [k for k, name in enumerate(tool.names) if name in here]
    which = [here[tool.names[k]] for k in at]
    prior = fit.problem.prior[which]
    values, axes = np.linalg.eigh(prior[:, None] * tool.gram[np.ix_(at, at)] * prior / len(tool.q))
    kept = values > 1e-12 * values.sum()  # in prior sigmas: metres and radians have no common size
    out = np.zeros((len(fit.model.names), int(kept.sum())))
    out[which] = axes[:, kept] * np.sqrt(values[kept])
    return out


def _minutes(samples: Samples) -> Array | None:
    """Return the time of each reading [min]; sessions follow each other, what lies between two is a pose's time."""
    if samples.t is None:
        return None
    out, begun = np.zeros(len(samples)), 0.0
    for k in np.unique(samples.session_numbers):
        own = np.flatnonzero(samples.session_numbers == k)
        t = samples.t[own]
        if np.any(np.diff(t) < 0) or np.ptp(t) <= 0.0:
            return None
        out[own] = begun + t - t[0]
        begun = out[own[-1]] + float(np.median(np.diff(t)))
    return np.asarray(out / 60.0)
