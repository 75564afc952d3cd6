"""The error on poses that the fit never saw, for all folds from one linearisation about the whole fit.

Taking a fold out moves the parameters so little that the model is linear over the way; the information of the other
folds is the whole less the fold's own (the leave-one-out formula by leverages, for groups). A test refits in full.
"""

from collections.abc import Iterator, Sequence
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
    return _judged(fit, split, _grams(fit.problem, fit.errors, split), np.full(len(fit.errors), np.nan))


def held_out_without(
    fit: Fit, split: Split, effects: Sequence[Sequence[int]], known: Sequence[int] = ()
) -> Iterator[HeldOut]:
    """Yield the same with each of some effects left out and everything else fitted anew beside it.

    Args:
        fit: with all of them; its noise and prior sizes stay.
        split: of the fit's samples.
        effects: positions of each effect's parameters.
        known: positions of parameters that stay as they are.
    """
    grams = _grams(fit.problem, fit.errors, split)
    for which in effects:
        step = np.full(len(fit.errors), np.nan)
        step[list(known)] = 0.0
        step[list(which)] = -(fit.errors / fit.problem.prior)[list(which)]
        yield _judged(fit, split, grams, step)


def _judged(fit: Fit, split: Split, grams: Array, step: Array) -> HeldOut:
    """Predict every sample; ``step`` (P,): steps in prior sizes that are given, not a number where one is sought."""
    problem, errors = fit.problem, fit.errors
    total = grams.sum(axis=0)
    z = errors / problem.prior
    shift = np.zeros((split.folds, len(errors)))
    own = np.zeros(shift.shape, dtype=bool)
    for f, gram in enumerate(grams):
        own[f] = np.isnan(step) & (np.diag(gram)[:-1] > (1 - NOTHING) * np.diag(total)[:-1])
        shift[f] = problem.prior * _without(total - gram, gram, z, own[f], step)
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


def _without(train: Array, fold: Array, z: Array, own: np.ndarray, step: Array) -> Array:
    """Step in prior sizes from the whole fit to the fit by the ``train`` information.

    Parameters that only the fold knows (where its plate lies) are then fitted on the fold itself.
    """
    move = np.where(np.isnan(step), 0.0, step)
    common = np.flatnonzero(~own & np.isnan(step))
    H = train[np.ix_(common, common)] + np.eye(len(common))
    move[common] = np.linalg.solve(H, train[common, -1] - z[common] - train[common, :-1] @ move)
    if own.any():
        mine = np.flatnonzero(own)
        H = fold[np.ix_(mine, mine)] + np.eye(len(mine))
        move[mine] = np.linalg.solve(H, fold[mine, -1] - fold[mine, :-1] @ move - z[mine])
    return move


def _moved(problem: Problem, errors: Array, shift: Array, split: Split) -> Array:
    """Residuals (n, r) after moving the parameters by the shift of each sample's fold."""

    def one(part: slice) -> Array:
        linear = problem.linear(part, errors)
        return np.asarray(linear.residual - np.einsum("nrp,np->nr", linear.rows, shift[split.fold[part]]))

    return np.concatenate(list(problem.over_pieces(one)))
