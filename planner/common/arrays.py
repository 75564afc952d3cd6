"""Arrays with one entry a row: their means by group."""

import numpy as np

from planner.common.units import Array


def mean_by_group(values: Array, group: np.ndarray) -> Array:
    """Return the mean of values (n,) or (n, k) in each group 0 … G − 1, (G,) or (G, k); NaN where a group has none."""
    count = np.bincount(group)
    sums = np.stack([np.bincount(group, column) for column in np.atleast_2d(values.T)], axis=1)
    with np.errstate(invalid="ignore"):
        return np.asarray(sums / count[:, None]).reshape(-1, *values.shape[1:])
