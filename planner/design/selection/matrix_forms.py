"""Forms of candidate rows J (n, r, P) that every criterion is made of: information, prices, pairs, swaps."""

import numpy as np

from planner.common.units import Array


def information_matrix(rows: Array) -> Array:
    """Sum of J_i'J_i, (P, P), over rows (n, r, P)."""
    tall = rows.reshape(-1, rows.shape[2])
    return np.asarray(tall.T @ tall)


def quadratic_form(rows: Array, matrix: Array) -> Array:
    """Return <matrix, J_i'J_i> (n,) for rows (n, r, P) and a symmetric matrix (P, P)."""
    tall = rows.reshape(-1, rows.shape[2])
    values = np.einsum("ij,ij->i", tall @ matrix, tall)
    return np.asarray(values.reshape(len(rows), -1).sum(axis=1))


def pairwise_form(rows: Array, left: Array, right: Array) -> Array:
    """tr(left M_i right M_j) for all pairs of rows, (n, n), M_i = J_i'J_i; all matrices are symmetric."""
    n, r, size = rows.shape
    cached_rows = 96  # of a product: they stay in the processor's cache
    tall, out, step = rows.reshape(-1, size), np.empty((n, n)), n if r == 1 else max(1, cached_rows // r)
    one = tall @ left
    two = one if right is left else tall @ right
    for k in range(0, n, step):  # upper triangle, in blocks that stay in the cache
        mine, others = slice(k * r, (k + step) * r), tall[k * r :].T
        products = one[mine] @ others
        products *= products if two is one else two[mine] @ others
        if r > 1:  # strided sums are several times as quick as a sum over two axes of four
            products = np.asarray(sum(products[i::r] for i in range(r)))
            products = np.asarray(sum(products[:, i::r] for i in range(r)))
        out[k:, k : k + step] = products.T
        out[k : k + step, k:] = products
    return out


def swap_log_ratios(inner: Array, outer: Array, inverse: Array, sign: float = 1.0) -> Array:
    """Log of det(A + sign (V'V - U'U)) / det(A), (n, m), for U in ``inner`` (n, r, P) and V in ``outer`` (m, r, P).

    ``inverse`` is A^-1. A change of rank 2 r (Sylvester); for r = 1 it is (1 + s v'A^-1 v)(1 - s u'A^-1 u) +
    (u'A^-1 v)^2. Adding first shows that only one eigenvalue can turn negative then, so the sign of the ratio tells
    whether the matrix stays positive definite. The logarithm is very low where it does not.
    """
    (n, r, size), m = inner.shape, len(outer)
    if r == 1:
        u, v = inner[:, 0], outer[:, 0]
        half = u @ inverse
        ratio = half @ v.T
        ratio *= ratio
        ratio += np.outer(
            1.0 - sign * np.einsum("ij,ij->i", half, u), 1.0 + sign * np.einsum("ij,ij->i", v @ inverse, v)
        )
    else:
        half = inner @ inverse
        cross = (half.reshape(n * r, size) @ outer.reshape(m * r, size).T).reshape(n, r, m, r).transpose(0, 2, 1, 3)
        block = np.empty((n, m, 2 * r, 2 * r))
        block[:, :, :r, :r] = np.eye(r) - sign * (half @ inner.swapaxes(1, 2))[:, None]
        block[:, :, :r, r:] = -sign * cross
        block[:, :, r:, :r] = sign * cross.swapaxes(2, 3)
        block[:, :, r:, r:] = np.eye(r) + sign * (outer @ inverse @ outer.swapaxes(1, 2))[None]
        ratio = np.linalg.det(block)
    return np.asarray(np.log(np.maximum(ratio, 1e-300, out=ratio), out=ratio))


def trial_log_ratios(inner: Array, trials: Array, inverse: Array, sign: float = 1.0) -> Array:
    """:func:`swap_log_ratios` of each U in ``inner`` (n, P) for its own V in ``trials`` (n, T, P) alone, (n, T)."""
    half = inner @ inverse
    cross = (trials @ half[:, :, None])[:, :, 0]
    out, into = np.sum(half * inner, axis=1), np.sum((trials @ inverse) * trials, axis=2)
    ratio = (1.0 - sign * out)[:, None] * (1.0 + sign * into) + cross**2
    return np.asarray(np.log(np.maximum(ratio, 1e-300)))


def project_semidefinite(matrix: Array) -> Array:
    """Return the nearest positive semidefinite matrix; one with a number that is not finite becomes zero."""
    if not np.all(np.isfinite(matrix)):
        return np.zeros_like(matrix)
    mu, axes = np.linalg.eigh((matrix + matrix.T) / 2)
    return np.asarray((axes * np.maximum(mu, 0.0)) @ axes.T)


def sum_largest(values: Array, count: int) -> float:
    """Sum of the ``count`` largest of ``values``."""
    return float(np.sum(np.partition(values, len(values) - count)[len(values) - count :]))
