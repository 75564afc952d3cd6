"""Fits that outliers do not pull: the weights of Huber and of Tukey, and the scale that they count by.

Source: Huber, Robust Statistics (1981); Holland and Welsch, Comm. Stat. A6 (1977).
"""

import numpy as np

from planner.common.units import Array

HUBER_SIGMAS = 1.5
"""[sigma] from which on a reading counts less: 95 % as sharp as least squares where the noise is normal."""
MEDIAN_NORM = {1: 0.6745, 3: 1.5382, 6: 2.3126}
"""Median of the norm of so many standard normal numbers: the root of the median of χ²."""


def huber_weights(size: Array, limit: float | Array) -> Array:
    """Return Huber's weights of residuals by their sizes (...): 1 up to the limit, falling with the size beyond."""
    far = ~(np.asarray(size) <= limit)  # what is not a number keeps that as its weight
    return np.divide(limit, size, out=np.ones(far.shape), where=far)


def huber_costs(size: Array, limit: float) -> Array:
    """Return Huber's cost of residuals of sizes (...): their square, and a straight line beyond the limit."""
    return np.where(size > limit, 2 * limit * size - limit * limit, size * size)


def tukey_weights(size: Array, limit: float) -> Array:
    """Return Tukey's weights of residuals by their sizes (...): nought from the limit on."""
    return np.asarray(np.clip(1.0 - (size / limit) ** 2, 0.0, None) ** 2)


def tukey_costs(size: Array, limit: float) -> Array:
    """Return Tukey's cost of residuals of sizes (...): constant beyond the limit."""
    return np.asarray(limit * limit / 3.0 * (1.0 - np.clip(1.0 - (size / limit) ** 2, 0.0, None) ** 3))
