"""What a set of readings says about the parameters: triangular factor, covariance, standard deviations.

Everything starts from the triangular factor R of the stacked rows (J = Q R), found in pieces, so that the condition
number is never squared by forming J'J and memory stays bounded by one piece.
"""

from dataclasses import dataclass

import numpy as np

from planner.errors import InputError
from planner.units import Array, frozen

from .indices import stacked

_PIECE = 16_384  # rows a piece: a few MB, and a tall enough matrix for blocked Householder


def r_factor(rows: Array) -> Array:
    """Return R (P, P), upper triangular with R'R = J'J, of rows (n, r, P) or (n, P), by a tall-skinny QR in pieces.

    Source: Demmel, Grigori, Hoemmen, Langou 2012 (TSQR). Fewer rows than columns leave zero rows in R.

    Raises:
        InputError: a row holds a number that is not finite.
    """
    tall = stacked(rows)
    if not np.all(np.isfinite(tall)):
        bad = int(np.flatnonzero(~np.all(np.isfinite(tall), axis=1))[0])
        raise InputError(f"row {bad} of the identification Jacobian holds a number that is not finite")
    parts = [np.linalg.qr(tall[k : k + _PIECE], mode="r") for k in range(0, len(tall), _PIECE)]
    factor = np.linalg.qr(np.concatenate(parts), mode="r") if parts else np.zeros((0, tall.shape[1]))
    out = np.zeros((tall.shape[1], tall.shape[1]))
    out[: len(factor)] = factor
    return out


@dataclass(frozen=True)
class Covariance:
    """Predicted covariance of the parameters after a measurement.

    ``matrix`` (P, P), ``std`` (P,) in m or rad, ``correlation`` (P, P); ``inflation`` (P,) is the ratio of ``std`` to
    what it would be were all the other parameters known: large means hard to tell apart.
    """

    matrix: Array
    std: Array
    correlation: Array
    inflation: Array


def covariance(rows: Array, noise: float | Array, prior: Array | None = None) -> Covariance:
    """Return the covariance of the best unbiased fit to the readings of ``rows`` (n, r, P).

    ``noise`` is the standard deviation of a reading, one for all or one a reading (n, r) [m or rad]; ``prior`` (P,), if
    given, enters as one further reading of every parameter with that standard deviation (a Bayesian fit).

    Raises:
        InputError: noise or prior is not positive, or without a prior the rows leave a direction unseen.
    """
    weights = np.asarray(noise, dtype=float)
    if np.any(weights <= 0) or (prior is not None and np.any(np.asarray(prior) <= 0)):
        raise InputError("the noise of a reading and every prior size must be above zero")
    white = rows / (weights[..., None] if weights.ndim else weights)
    tall = stacked(white)
    if prior is not None:
        tall = np.concatenate([tall, np.diag(1.0 / np.asarray(prior))])
    size = np.linalg.norm(tall, axis=0)
    if np.any(size == 0):
        raise InputError(f"parameter {int(np.argmin(size))} moves no reading: drop it, or give it a prior")
    _, mu, axes = np.linalg.svd(r_factor(tall / size))
    if mu[-1] <= mu[0] * len(mu) * np.finfo(float).eps:
        raise InputError("the poses leave a direction of the parameters unseen: drop parameters, or give a prior")
    root = (axes.T / mu) / size[:, None]
    matrix = root @ root.T
    std = np.sqrt(np.diag(matrix))
    return Covariance(frozen(matrix), frozen(std), frozen(matrix / np.outer(std, std)), frozen(std * size))


def sensitivity(rows: Array) -> Array:
    """Return the root-mean-square change of a reading per unit of each parameter (P,), over rows (n, r, P)."""
    tall = stacked(rows)
    return np.asarray(np.sqrt(np.mean(tall**2, axis=0)))
