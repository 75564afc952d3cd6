"""Rotations, batched over any leading axes: exponential and logarithm, the nearest rotation, skew matrices."""

import numpy as np
from scipy.spatial.transform import Rotation

from planner.common.units import Array

_TIE = 1e-9  # weight of "closest to no rotation" where the data leave a rotation open


def skew(v: Array) -> Array:
    """Return the matrices [v]× (..., 3, 3) of vectors v (..., 3)."""
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def exp3(w: Array) -> Array:
    """Return the rotations (..., 3, 3) of rotation vectors w (..., 3) [rad]."""
    return np.asarray(Rotation.from_rotvec(w.reshape(-1, 3)).as_matrix()).reshape(*w.shape, 3)


def log3(R: Array) -> Array:
    """Return the rotation vectors (..., 3) [rad] of rotations R (..., 3, 3), exact up to π."""
    return np.asarray(Rotation.from_matrix(R.reshape(-1, 3, 3)).as_rotvec()).reshape(R.shape[:-1])


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
