"""Readings and columns in standard deviations of what the noise and the columns of known size make of them."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg.blas import dsyrk, dtrsm

from planner.common.units import Array


@dataclass(frozen=True)
class ReadingWhitener:
    """C₀^(−1/2) of the readings, with C₀ their covariance by noise D and the columns of known size.

    These may be wider than the noise by many orders of magnitude, and are taken by their singular values: beside them
    D⁻¹ᐟ² C₀ D⁻¹ᐟ² is 1 + U σ² Uᵀ. The families that act are mild and few, and enter by Woodbury's identity.

    Attributes:
        root: standard deviations of the noise D, (m,).
        axes: U of the known columns, (m, k).
        shrink: 1/√(1 + σ²) − 1, (k,).
    """

    root: Array
    axes: Array
    shrink: Array

    @classmethod
    def of(cls, known: Array, root: Array) -> "ReadingWhitener":
        """Look at columns of known size (m, k) beside the standard deviations of the noise (m,)."""
        axes, wide, _ = np.linalg.svd(known / root[:, None], full_matrices=False)
        return cls(root, axes, 1 / np.sqrt(1 + wide**2) - 1)

    def white(self, values: Array) -> Array:
        """Return C₀^(−1/2) times columns (m, q)."""
        out = values / self.root[:, None]
        out += self.axes * self.shrink @ (self.axes.T @ out)
        return np.asarray(out)

    def apply_transpose(self, values: Array) -> Array:
        """Return the transpose of C₀^(−1/2) times columns (m, q)."""
        return np.asarray((values + self.axes * self.shrink @ (self.axes.T @ values)) / self.root[:, None])

    def products(self, columns: Array, size: Array) -> Array:
        """Return XᵀC⁻¹X of columns (m, q), its lower triangle, where the first act with sizes (a,), 0 if they do not.

        Where few columns act, XᵀC⁻¹X = P − FᵀF with P = XᵀC₀⁻¹X and F as of :func:`explained_products`; where many do,
        the readings are fewer, and the whole of C has a root.
        """
        white, acting = self.white(columns), np.flatnonzero(size)
        if len(acting) * len(size) < len(white) ** 2:
            told = explained_products(white, size)
            out = dsyrk(1.0, white.T, lower=1)
            return np.asarray(dsyrk(-1.0, told, 1.0, out, trans=1, lower=1, overwrite_c=1) if len(told) else out)
        own = white[:, acting] * size[acting]
        root = np.linalg.cholesky(np.eye(len(white)) + own @ own.T)
        return np.asarray(dsyrk(1.0, dtrsm(1.0, root, white, lower=1), trans=1, lower=1))


def explained_products(white: Array, size: Array) -> Array:
    """Return F = L⁻¹ S XᵀX (k, q) over the k columns that act, S their sizes and L Lᵀ = 1 + S XᵀX S.

    ``white``: X, of which the first columns act with sizes (a,), 0 if they do not, (m, q).
    """
    acting = np.flatnonzero(size)
    if not len(acting):
        return np.zeros((0, white.shape[1]))
    rows = size[acting, None] * (white[:, acting].T @ white)
    root = np.linalg.cholesky(np.eye(len(acting)) + rows[:, acting] * size[acting])
    return np.asarray(dtrsm(1.0, root, rows, lower=1))
