"""Orthonormal bases of the rows of a Jacobian."""

import numpy as np
from scipy.linalg import cholesky
from scipy.linalg.blas import dtrsm
from scipy.linalg.lapack import dtrcon

from planner.common.units import Array

REFLECTED_NUMBERS = 20_000  # of rows, up to which their basis is found by Householder's reflections


def posterior_basis(rows: Array, prior_weight: float) -> tuple[Array, Array]:
    """Return the readings' part (m, P) of an orthonormal basis of rows (m, P) with the prior's below them, and R.

    Of many rows by the Cholesky factor of their products, which squares the condition number. Where that is large twice
    over, which is as exact as Householder's reflections where the first one exists at all (Yamamoto et al. 2015, ETNA
    44).
    """
    prior = np.eye(rows.shape[1]) * np.sqrt(prior_weight)
    if rows.size > REFLECTED_NUMBERS:
        try:
            Q, below, R = _orthogonalise(rows, prior)
            # 1e-6: reciprocal condition number of R, from which on one factor is exact to 1e-4 and mostly 1e-10
            if dtrcon(R)[0] > 1e-6:
                return Q, R
            Q, below, more = _orthogonalise(Q, below, over=True)
            if np.abs(more - np.eye(len(more))).max() < 1e-3:  # how far the first of two orthogonalisations may be off
                return Q, more @ R
        except np.linalg.LinAlgError:
            pass
    Q, R = np.linalg.qr(np.vstack([rows, prior]))
    return np.asarray(Q[: len(rows)]), np.asarray(R)


def space_basis(rows: Array) -> Array:
    """Return an orthonormal basis (m, rank) of the columns of rows (m, P).

    Few rows are reflected as in :func:`posterior_basis`, which gives P vectors. Of many rows the eigenvectors of
    RᵀR give a first basis, which is then made orthogonal once more.
    """
    if rows.size <= REFLECTED_NUMBERS:
        return posterior_basis(rows, 0.0)[0]
    size = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    square, axes = np.linalg.eigh((rows.T @ rows) / np.outer(size, size))
    seen = square > 1e-6**2 * square[-1]  # of a combination of columns of unit length, below which it is rounding
    Q = rows @ (axes[:, seen] / np.sqrt(square[seen]) / size[:, None])
    return _orthogonalise(Q, np.zeros((0, Q.shape[1])), over=True)[0]


def _orthogonalise(rows: Array, below: Array, over: bool = False) -> tuple[Array, Array, Array]:
    """Return rows (m, P) and (P, P) below them times R⁻¹, and R, the Cholesky factor of their products.

    ``over``: the rows may be written over.
    """
    gram = rows.T @ rows + below.T @ below
    size = np.sqrt(np.diag(gram))
    R = cholesky(gram / np.outer(size, size)) * size
    return dtrsm(1.0, R, rows.T, trans_a=1, overwrite_b=over).T, dtrsm(1.0, R, below.T, trans_a=1).T, R
