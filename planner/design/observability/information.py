"""What readings say about the parameters: observability indices O1 to O5, triangular factor, covariance.

Sources of the indices: O1 Borm and Menq 1991; O2 Driels and Pathre 1990; O3, O4 Nahvi and Hollerbach 1996; O5 Sun and
Hollerbach 2008, whose O5 is 1 / sum(1/mu). With mu_1 >= ... >= mu_r the singular values of the stacked rows. The
triangular factor R of the rows (J = Q R) is found in pieces, so that the condition number is never squared by J'J."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from planner.common.choices import IndexName
from planner.common.errors import InputError, did_you_mean
from planner.common.units import Array, read_only

T = TypeVar("T", float, Array)


def _o1(mu: Array, poses: int) -> Array:
    with np.errstate(divide="ignore"):
        return np.asarray(np.exp(np.mean(np.log(mu), axis=-1)) / np.sqrt(poses))


def _o5(mu: Array, poses: int) -> Array:
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / np.sum(1.0 / mu, axis=-1))


def _o2(mu: Array, poses: int) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(mu[..., 0] / mu[..., -1])


@dataclass(frozen=True)
class IndexRule:
    """One index: the sense of better and its formula on descending singular values (..., r) and a count of poses."""

    name: IndexName
    maximise: bool
    what: str
    of: Callable[[Array, int], Array]

    @property
    def of_raw(self) -> str:
        """What it is of raw columns, with their units: its value depends on them."""
        return f"{self.what} in m, rad"

    def is_better(self, value: float, than: float) -> bool:
        """Tell whether ``value`` is strictly better than ``than``."""
        return value > than if self.maximise else value < than

    def merit(self, values: T) -> T:
        """Return ``values`` with the sign with which the largest is the best."""
        return values if self.maximise else -values

    def gap(self, value: float, bound: float) -> float:
        """Return how far ``value`` is from ``bound``, as a share of the better of the two (0: proven optimal)."""
        return bound / value - 1.0 if self.maximise else value / bound - 1.0


INDEX_RULES: dict[str, IndexRule] = {
    rule.name: rule
    for rule in (
        IndexRule("O1", True, "geometric mean of the singular values over the root of the poses", _o1),
        IndexRule("O2", False, "condition number", _o2),
        IndexRule("O3", True, "smallest singular value", lambda mu, _: np.asarray(mu[..., -1])),
        IndexRule("O4", True, "noise amplification index", lambda mu, _: np.asarray(mu[..., -1] ** 2 / mu[..., 0])),
        IndexRule("O5", True, "inverse of the sum of inverse singular values", _o5),
    )
}


def find_rule(kind: str) -> IndexRule:
    """Return the rule of an index by name.

    Raises:
        InputError: the name is none of O1 ... O5.
    """
    if kind not in INDEX_RULES:
        raise InputError(
            f"index {kind!r} is unknown; allowed are {', '.join(INDEX_RULES)}{did_you_mean(kind, list(INDEX_RULES))}"
        )
    return INDEX_RULES[kind]


def stack_rows(rows: Array) -> Array:
    """Return rows (n, r, P), or (n, P) for one reading a pose, as the tall matrix (n r, P)."""
    return np.reshape(rows, (-1, rows.shape[-1]))


def singular_values(rows: Array) -> Array:
    """Return the singular values, descending, (P,) of rows (n, r, P); zeros fill up when there are too few rows."""
    tall = stack_rows(rows)
    mu = np.zeros(tall.shape[1])
    found = np.linalg.svd(tall, compute_uv=False)
    mu[: len(found)] = found
    return mu


def index_value(kind: str, rows: Array, scale: Array | None = None) -> float:
    """Return one index of the pose set ``rows`` (n, r, P) or (n, P); a set that sees too little gets its worst value.

    ``scale`` (P,) multiplies the columns: with each parameter's prior sigma the index is free of units.
    """
    mu = singular_values(rows if scale is None else rows * scale)
    return _apply_rule(find_rule(kind), mu, len(rows))


def _apply_rule(index: IndexRule, mu: Array, poses: int) -> float:
    """Apply the formula, with numerically zero singular values (below rounding) taken as zero."""
    floor = mu[0] * len(mu) * np.finfo(float).eps
    mu = np.where(mu > floor, mu, 0.0)
    return float(np.nan_to_num(index.of(mu, poses), nan=np.inf, posinf=np.inf))


def all_indices(rows: Array, scale: Array | None = None) -> dict[str, float]:
    """Return all five indices of a pose set ``rows`` (n, r, P) by name; ``scale`` as in :func:`index_value`."""
    mu = singular_values(rows if scale is None else rows * scale)
    return {name: _apply_rule(each, mu, len(rows)) for name, each in INDEX_RULES.items()}


def r_factor(rows: Array) -> Array:
    """Return R (P, P), upper triangular with R'R = J'J, of rows (n, r, P) or (n, P), by a tall-skinny QR in pieces.

    Source: Demmel, Grigori, Hoemmen, Langou 2012 (TSQR). Fewer rows than columns leave zero rows in R.

    Raises:
        InputError: a row holds a number that is not finite.
    """
    piece = 16_384  # rows: a few MB, and a tall enough matrix for blocked Householder
    tall = stack_rows(rows)
    if not np.all(np.isfinite(tall)):
        bad = int(np.flatnonzero(~np.all(np.isfinite(tall), axis=1))[0])
        raise InputError(f"row {bad} of the identification Jacobian holds a number that is not finite")
    parts = [np.linalg.qr(tall[k : k + piece], mode="r") for k in range(0, len(tall), piece)]
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


def predict_covariance(rows: Array, noise: float | Array, prior: Array | None = None) -> Covariance:
    """Return the covariance of the best unbiased fit to the readings of ``rows`` (n, r, P).

    ``noise`` is the standard deviation of a reading, one for all or one a reading (n, r) [m or rad]; ``prior`` (P,), if
    given, enters as one further reading of every parameter with that standard deviation (a Bayesian fit).

    Raises:
        InputError: noise or prior is not positive, or without a prior the rows leave a direction unseen.
    """
    weights = np.asarray(noise, dtype=float)
    if np.any(weights <= 0) or (prior is not None and np.any(np.asarray(prior) <= 0)):
        raise InputError("the noise of a reading and every prior sigma must be above zero")
    white = rows / (weights[..., None] if weights.ndim else weights)
    tall = stack_rows(white)
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
    return Covariance(read_only(matrix), read_only(std), read_only(matrix / np.outer(std, std)), read_only(std * size))


def marginal_information(information: Array, nuisance: np.ndarray) -> Array:
    """Return the information (per prior sigma) about the parameters of interest, from that of all (P, P).

    Those in ``nuisance`` (P,) bool are known to their prior sigmas, and fitted with the rest (a Schur complement).
    """
    kept = ~nuisance
    across = information[np.ix_(kept, nuisance)]
    inner = information[np.ix_(nuisance, nuisance)] + np.eye(int(nuisance.sum()))
    return np.asarray(information[np.ix_(kept, kept)] - across @ np.linalg.solve(inner, across.T))


def rms_sensitivity(rows: Array) -> Array:
    """Return the root-mean-square change of a reading per unit of each parameter (P,), over rows (n, r, P)."""
    tall = stack_rows(rows)
    return np.asarray(np.sqrt(np.mean(tall**2, axis=0)))
