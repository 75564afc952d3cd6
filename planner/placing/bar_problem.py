"""Residuals of a length gauge, and the linear solutions that its first starts come from."""

from dataclasses import dataclass

import numpy as np

from planner.placing.inputs import Stand
from planner.units import Array


@dataclass(frozen=True)
class BarProblem:
    """length = |R m + p − X| + zero; a state is (m (3T), X (3S), zero), of which ``free`` (bool) move."""

    stand: Stand
    length: Array
    free: np.ndarray

    def evaluate(self, state: Array) -> tuple[Array, Array]:
        """Return residuals (k, n, 1) [m] and derivatives (k, n, 1, P)."""
        s, k = self.stand, len(state)
        m, X, zero = unpacked(state, s)
        apart = s.carried(m) - X[:, s.place]
        distance = np.linalg.norm(apart, axis=2)
        u = apart / np.maximum(distance, 1e-9)[..., None]
        J = np.zeros((k, len(s), state.shape[1]))
        row = np.arange(len(s))[:, None]
        J[:, row, 3 * s.point[:, None] + np.arange(3)] = np.matmul(u[..., None, :], s.R_BF)[..., 0, :]
        J[:, row, 3 * (s.n_points + s.place[:, None]) + np.arange(3)] = -u
        J[:, :, -1] = 1.0
        return (distance + zero[:, None] - self.length)[..., None], J[:, :, None, self.free]

    def moved(self, state: Array, step: Array) -> Array:
        """Return the moved states (k, D)."""
        out = state.copy()
        out[:, self.free] += step
        return out


def unpacked(state: Array, stand: Stand) -> tuple[Array, Array, Array]:
    """Return p_FM (k, T, 3), p_BX (k, S, 3) and the zero (k,) of states (k, D)."""
    T, k = stand.n_points, len(state)
    return state[:, : 3 * T].reshape(k, T, 3), state[:, 3 * T : -1].reshape(k, -1, 3), state[:, -1]


def packed(p_FM: Array, p_BX: Array, zero: Array) -> Array:
    """Return states (k, D) of :func:`unpacked`."""
    k = len(zero)
    return np.concatenate([p_FM.reshape(k, -1), p_BX.reshape(k, -1), zero[:, None]], axis=1)


def trilateration(centre: Array, length: Array, zero: Array) -> tuple[Array, Array]:
    """Locate a point from lengths to known centres; the difference of squared lengths is linear in it.

    L² − |c|² = 2 z L − 2 c·X + (|X|² − z²), reweighted against outliers.

    Args:
        centre: (k, n, 3) [m].
        length: (n,) [m].
        zero: (k,) [m]; NaN: unknown, a column L is added.

    Returns:
        The point (k, 3) and the zero (k,) [m].
    """
    known = bool(np.isfinite(zero).all())
    reach = length - (zero[:, None] if known else 0.0)
    b = reach**2 - (centre**2).sum(axis=2)
    columns = -2.0 * centre
    if not known:
        columns = np.concatenate([columns, np.broadcast_to(2.0 * length[:, None], (*b.shape, 1))], axis=2)
    x = reweighted(columns, b)
    return x[:, :3], zero if known else x[:, 3]


def reweighted(columns: Array, b: Array) -> Array:
    """Return x (k, P) of columns (k, n, P) x + constant = b (k, n), by least squares with three Huber reweightings."""
    weight = np.ones_like(b)
    for _ in range(4):
        w = weight / weight.sum(axis=1, keepdims=True)
        C = columns - np.einsum("kn,knp->kp", w, columns)[:, None]
        d = b - np.einsum("kn,kn->k", w, b)[:, None]
        Cw = (C * w[..., None]).transpose(0, 2, 1)
        x = np.matmul(np.linalg.pinv(Cw @ C, rcond=1e-11, hermitian=True), Cw @ d[..., None])
        r = np.abs(d - (C @ x)[..., 0])
        scale = np.maximum(np.median(r, axis=1, keepdims=True) / 0.6745, 1e-12)
        weight = np.minimum(1.0, 1.5 * scale / np.maximum(r, 1e-300))
    return np.asarray(x[..., 0])


def lifted(stand: Stand, length: Array) -> tuple[Array, Array, Array]:
    """Locate tool point and fixture of one pair together, no start needed, from 17 linear unknowns.

    L² − |p|² = 2 z L + 2 (Rᵀp)·m − 2 p·X − 2 Xᵀ R m + constant: the products X mᵀ (9) are taken as unknowns of their
    own, then split into their strongest rank-one part.

    Returns:
        m (2, 3), X (2, 3), zero (2,) [m]: from the linear terms, and with m from the products.
    """
    origin = stand.p_BF.mean(axis=0)
    p, n = stand.p_BF - origin, len(stand)
    turned = np.einsum("nji,nj->ni", stand.R_BF, p)
    columns = np.concatenate([2 * turned, -2 * p, 2 * length[:, None], -2 * stand.R_BF.reshape(n, 9)], axis=1)
    x = reweighted(columns[None], (length**2 - (p**2).sum(axis=1))[None])[0]
    m, X, product = x[:3], x[3:6], x[7:].reshape(3, 3)
    by_product = product.T @ X / max(float(X @ X), 1e-12)
    return np.stack([m, by_product]), np.stack([X, X]) + origin, np.full(2, x[6])
