"""The error on poses that the fit never saw, for all folds from one linearisation about the whole fit.

Taking a fold out moves the parameters so little that the model is linear over the way; the information of the other
folds is the whole less the fold's own (the leave-one-out formula by leverages, for groups). A test refits in full.
"""

from dataclasses import dataclass

import numpy as np

from planner.identification.fit import Fit
from planner.identification.problem import Problem
from planner.identification.splits import Split
from planner.units import Array

NOTHING = 1e-9  # share of a column's information below which the training folds say nothing of its parameter


@dataclass(frozen=True)
class HeldOut:
    """Residuals on samples that were held out.

    Attributes:
        residual: reading − prediction by the fit without the sample's fold, (n, r) [m, rad].
        shift: what taking out each fold moves the parameters by, (folds, P).
        refitted: names of parameters that were fitted on the held-out samples, for only these know them.
    """

    residual: Array
    shift: Array
    refitted: tuple[str, ...]


def held_out(fit: Fit, split: Split) -> HeldOut:
    """Predict every sample by the fit without its fold."""
    problem, errors = fit.problem, fit.errors
    grams = _grams(problem, errors, split)
    total = grams.sum(axis=0)
    z = errors / problem.prior
    shift = np.zeros((split.folds, len(errors)))
    own = np.zeros(shift.shape, dtype=bool)
    for f, gram in enumerate(grams):
        own[f] = np.diag(gram)[:-1] > (1 - NOTHING) * np.diag(total)[:-1]
        shift[f] = problem.prior * _without(total - gram, gram, z, own[f])
    names = fit.model.names
    return HeldOut(
        _moved(problem, errors, shift, split), shift, tuple(names[j] for j in np.flatnonzero(own.any(axis=0)))
    )


def _grams(problem: Problem, errors: Array, split: Split) -> Array:
    """Information [J r]ᵀ[J r] of every fold, (folds, P+1, P+1)."""

    def one(part: slice) -> Array:
        piece = problem.piece(part, errors)
        fold, size = split.fold[part], len(piece.columns)
        out = np.zeros((split.folds, size, size))
        for f in np.unique(fold):
            columns = piece.columns[:, :, fold == f].reshape(size, -1)
            out[f] = columns @ columns.T
        return out

    return np.asarray(sum(problem.over_pieces(one)))


def _without(train: Array, fold: Array, z: Array, own: np.ndarray) -> Array:
    """Step in prior sizes from the whole fit to the fit by the ``train`` information.

    Parameters that only the fold knows (where its plate lies) are then fitted on the fold itself.
    """
    move = np.zeros(len(z))
    common = np.flatnonzero(~own)
    H = train[np.ix_(common, common)] + np.eye(len(common))
    move[common] = np.linalg.solve(H, train[common, -1] - z[common])
    if own.any():
        mine = np.flatnonzero(own)
        H = fold[np.ix_(mine, mine)] + np.eye(len(mine))
        move[mine] = np.linalg.solve(H, fold[mine, -1] - fold[np.ix_(mine, common)] @ move[common] - z[mine])
    return move


def _moved(problem: Problem, errors: Array, shift: Array, split: Split) -> Array:
    """Residuals (n, r) after moving the parameters by the shift of each sample's fold."""

    def one(part: slice) -> Array:
        linear = problem.linear(part, errors)
        return np.asarray(linear.residual - np.einsum("nrp,np->nr", linear.rows, shift[split.fold[part]]))

    return np.concatenate(list(problem.over_pieces(one)))
