"""Coordinates in which the information of the whole pool is one: every comparison is then well conditioned."""

from dataclasses import dataclass

import numpy as np

from planner.observability.information import r_factor
from planner.units import Array

UNSEEN = 1e-8  # share of the largest singular value below which the pool does not see a direction
ALONG = 1e-6  # the same for what some columns span


@dataclass(frozen=True)
class Frame:
    """New coordinates of the columns.

    Attributes:
        to: (P, p): rows of the pool times it have the information one.
        columns: (p, P): where each column lies.
    """

    to: Array
    columns: Array

    @classmethod
    def of(cls, rows: Array) -> "Frame":
        """Take the coordinates from the rows (n, r, P) of the whole pool."""
        size = np.maximum(np.linalg.norm(rows.reshape(-1, rows.shape[2]), axis=0), 1e-300)
        _, mu, axes = np.linalg.svd(r_factor(rows / size))
        seen = mu > UNSEEN * mu[0]
        return cls((axes[seen].T / mu[seen]) / size[:, None], mu[seen, None] * axes[seen] * size)

    def rows(self, rows: Array) -> Array:
        """Rows (n, r, P) in the new coordinates, (n, r, p)."""
        return np.asarray(rows @ self.to)

    def span(self, which: np.ndarray) -> Array:
        """Orthonormal basis (p, k) of what some columns span."""
        columns = self.columns[:, which]
        size = np.linalg.norm(columns, axis=0)
        out, mu, _ = np.linalg.svd(columns[:, size > 0] / size[size > 0], full_matrices=False)
        return np.asarray(out[:, mu > ALONG * mu[0]])
