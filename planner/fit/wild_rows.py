"""Rows that stand far outside the others: the tails of the noise, by which they count for little.

Most rows err as the noise is; a few (a ball badly seated, a beam interrupted, a digit mistyped) err by any amount. The
numbers e of a row, in standard deviations, are a scale mixture of normals (Andrews and Mallows 1974, J. R. Stat. Soc. B
36(1)): with probability 1 − ε their scale is 1, with ε it is any from a few to a million, the logarithm being uniform.
A fit with such noise is least squares in which a row counts by the expected inverse square of its scale (Dempster,
Laird and Rubin 1980, Multivariate Analysis V). A row has part in the fit that it is held against. Each is therefore
held against what the others say of it, by its leverage.

The bulk is never narrower than nine rows in ten are spread. What the model does not hold widens the residuals of many
rows. Where more rows than a few stand apart they are a cause, or the noise, and none of them is wild. Up to even odds a
row counts in full, so that a run without wild rows is fitted by plain least squares.
"""

import numpy as np
from scipy.special import chdtri

from planner.common.units import Array
from planner.fit.assumptions import POSITION_AXES, WILD_PROBABILITY, WILD_SCALES


def unseen_weights(white: Array) -> Array:
    """Return by how much each row counts, (n,), where a fit has not seen it, or has so many that none decides.

    ``white``: residuals in standard deviations of the noise, (n, r).
    """
    return row_weights(white, np.zeros_like(white), np.ones(len(white)))


def row_weights(white: Array, leverage: Array, weight: Array) -> Array:
    """Return by how much each row counts, (n,), 1 for those that do not stand outside.

    Args:
        white: residuals of a fit in standard deviations of the noise, (n, r).
        leverage: of the readings in that fit, (n, r), 0 … 1.
        weight: of the rows in that fit, (n,).
    """
    if not len(white):
        return weight
    left = np.maximum(1.0 - leverage, 1e-3)  # of its noise a residual shows no less than this
    others = leverage / (left * np.maximum(weight, 1e-300)[:, None])  # variance of what the other rows say of it
    return expected_weights((white / left) ** 2, others)


def validation_weights(residual: Array) -> Array:
    """Return by how much rows count (n,) among residuals (n, r) [m] of rows that no fit saw, by what most are off."""
    position = residual[:, :POSITION_AXES]
    middle = float(np.median(np.linalg.norm(position, axis=1))) / np.sqrt(chdtri(position.shape[1], 0.5))
    return unseen_weights(position / max(middle, 1e-300))


def expected_weights(square: Array, others: Array) -> Array:
    """Return the same (n,) by squares of what the other rows leave of each number, and their own variance, (n, r)."""
    bulk = spread_of_bulk((square / (1.0 + others)).sum(axis=1), square.shape[1])
    near = _log_density(square, bulk + others)
    far, share = _wild_density(square, bulk * wild_scales() ** 2, others)
    log_odds = np.log(WILD_PROBABILITY / (1 - WILD_PROBABILITY)) + far - near
    wild = 1.0 / (1.0 + np.exp(-np.clip(log_odds, -700.0, 700.0)))
    small = share @ wild_scales() ** -2.0
    return np.asarray(np.minimum(1.0, 2.0 * (1.0 - wild)) * (1.0 - small) + small)


def wild_cost(white: Array, weight: Array) -> float:
    """Return what wild rows cost beyond their weighted squares: −2 log density over that of the bulk, summed.

    Args:
        white: residuals in standard deviations, (n, r).
        weight: by how much each row counts, (n,); those that count in full cost nothing more.
    """
    wild = weight < 1.0
    square = white[wild] ** 2
    if not len(square):
        return 0.0
    far = _wild_density(square, wild_scales() ** 2, np.zeros_like(square))[0] + np.log(WILD_PROBABILITY)
    near = _log_density(square, np.ones_like(square)) + np.log(1 - WILD_PROBABILITY)
    return float((-2.0 * np.logaddexp(near, far) - weight[wild] * square.sum(axis=1)).sum())


def wild_scales() -> Array:
    """Return the scales that wild rows may have, in standard deviations, all as likely: neighbours differ by 1.4."""
    return np.geomspace(WILD_SCALES[0], WILD_SCALES[1], 81)[1::2]


def spread_of_bulk(square: Array, width: int) -> float:
    """Return the variance that most rows show at least, 1 or more, by the squares (n,) of ``width`` numbers each."""
    beyond = 0.1  # share of the rows that may be wild: of more than one in ten none ever is
    return max(1.0, float(np.quantile(square, 1 - beyond) / chdtri(width, beyond)))


def _wild_density(square: Array, variances: Array, others: Array) -> tuple[Array, Array]:
    """Return the log density (n,) of wild rows whose scales have ``variances`` (s,), and the scales' shares (n, s)."""
    logs = np.stack([_log_density(square, v + others) for v in variances], axis=1)
    top = logs.max(axis=1, keepdims=True)
    share = np.exp(logs - top)
    return np.asarray(top[:, 0] + np.log(share.mean(axis=1))), share / share.sum(axis=1, keepdims=True)


def _log_density(square: Array, variance: Array) -> Array:
    return np.asarray(-0.5 * (square / variance + np.log(variance)).sum(axis=1))
