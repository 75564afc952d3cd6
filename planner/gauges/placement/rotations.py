"""Rotations, batched over any leading axes: exponential and logarithm, the nearest rotation, skew matrices."""

import numpy as np

from planner.common.units import Array

_TIE = 1e-9  # weight of "closest to no rotation" where the data leave a rotation open


def skew(v: Array) -> Array:
    """Return the matrices [v]× (..., 3, 3) of vectors v (..., 3)."""
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def exp3(w: Array) -> Array:
    """Return the rotations (..., 3, 3) of rotation vectors w (..., 3) [rad] (Rodrigues)."""
    angle = np.linalg.norm(w, axis=-1)[..., None, None]
    K = skew(w)
    half = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2  # (1 − cos a) / a²
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * K + half * (K @ K))


def log3(R: Array) -> Array:
    """Return the rotation vectors (..., 3) [rad] of rotations R (..., 3, 3), exact up to π (by quaternions)."""
    q = _quaternion(R)
    sine = np.linalg.norm(q[..., 1:], axis=-1)
    angle = 2.0 * np.arctan2(sine, q[..., 0])
    return np.asarray(q[..., 1:] * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0)[..., None])


def _quaternion(R: Array) -> Array:
    """Return unit quaternions (..., 4), w ≥ 0 first: the largest column of 4 q qᵀ."""
    a, b, c = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    x, y, z = R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]
    xy, xz, yz = R[..., 0, 1] + R[..., 1, 0], R[..., 0, 2] + R[..., 2, 0], R[..., 1, 2] + R[..., 2, 1]
    rows = [
        (1 + a + b + c, x, y, z),
        (x, 1 + a - b - c, xy, xz),
        (y, xy, 1 - a + b - c, yz),
        (z, xz, yz, 1 - a - b + c),
    ]
    outer = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)  # (..., 4, 4)
    best = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(outer, best[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.asarray(np.where(q[..., :1] < 0, -q, q))


def nearest_rotation(H: Array) -> Array:
    """Return the rotations R that maximise tr(Rᵀ H), (..., 3, 3); where H leaves R open, the one nearest to identity.

    Source: Umeyama, IEEE PAMI 13 (1991), eq. 40–43; the open rotations are closed by a small multiple of I.
    """
    size = np.linalg.norm(H, axis=(-2, -1))[..., None, None]
    U, _, Vt = np.linalg.svd(H + np.maximum(_TIE * size, 1e-300) * np.eye(3))
    D = np.broadcast_to(np.eye(3), H.shape).copy()
    D[..., 2, 2] = np.sign(np.linalg.det(U @ Vt))
    return np.asarray(U @ D @ Vt)


def registration(a: Array, b: Array, weight: Array) -> tuple[Array, Array]:
    """Return R (..., 3, 3) and t (..., 3) that bring points b onto a: Σ w |a − R b − t|² least.

    Args:
        a, b: points (..., n, 3) [m].
        weight: (..., n), not negative.
    """
    w = weight / np.maximum(weight.sum(axis=-1, keepdims=True), 1e-300)
    mean_a, mean_b = np.einsum("...n,...ni->...i", w, a), np.einsum("...n,...ni->...i", w, b)
    da, db = a - mean_a[..., None, :], b - mean_b[..., None, :]
    R = nearest_rotation(np.einsum("...n,...ni,...nj->...ij", w, da, db))
    return R, mean_a - np.einsum("...ij,...j->...i", R, mean_b)
