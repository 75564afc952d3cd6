"""Geometry in space, batched: rotations and registration of points, circles, and the bar between two balls."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from planner.common.units import Array


@dataclass(frozen=True)
class BarState:
    """The bar between fixture X and measurement application point M.

    Attributes:
        length: distance of the balls, (n,) [m] (EDBB paper, eq. 2).
        direction: unit vector from X to M in the base frame, (n, 3).
    """

    length: Array
    direction: Array


def bar_state(p_BM: Array, p_BX: Array) -> BarState:
    """Return length and direction of the bar for points (n, 3) and fixture (3,) or (n, 3) [m]."""
    r = p_BM - p_BX
    length = np.sqrt(np.einsum("ni,ni->n", r, r))
    return BarState(length, r / np.maximum(length, 1e-12)[:, None])


def tilt_angle(direction: Array, axis: Array) -> Array:
    """Angle between unit vectors (n, 3) and an axis (3,) or (n, 3), (n,) [rad]; exact near 0 and near π."""
    axis = np.broadcast_to(axis, direction.shape)
    apart = np.linalg.norm(direction - axis, axis=1)
    together = np.linalg.norm(direction + axis, axis=1)
    return np.asarray(2.0 * np.arctan2(apart, together))


def skew(v: Array) -> Array:
    """Return the matrices [v]× (..., 3, 3) of vectors v (..., 3)."""
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def pose(R: Array, p: Array) -> Array:
    """Return the transform (4, 4) of a rotation R (3, 3) and a position p (3,) [m]."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    return T


def exp3(w: Array) -> Array:
    """Return the rotations (..., 3, 3) of rotation vectors w (..., 3) [rad]."""
    return np.asarray(Rotation.from_rotvec(w.reshape(-1, 3)).as_matrix()).reshape(*w.shape, 3)


def log3(R: Array) -> Array:
    """Return the rotation vectors (..., 3) [rad] of rotations R (..., 3, 3), exact up to π."""
    return np.asarray(Rotation.from_matrix(R.reshape(-1, 3, 3)).as_rotvec()).reshape(R.shape[:-1])


def rpy_of(R: Array) -> Array:
    """Return roll, pitch, yaw (3,) [rad] of a rotation (3, 3) = Rz(yaw) Ry(pitch) Rx(roll), as URDF has them.

    Where pitch is a right angle, roll and yaw are not told apart: roll is 0 there.
    """
    level = float(np.hypot(R[0, 0], R[1, 0]))
    pitch = float(np.arctan2(-R[2, 0], level))
    if level < 1e-9:  # cosine of a pitch below which the rounding of a rotation says nothing of roll
        return np.array([0.0, pitch, float(np.arctan2(-R[0, 1], R[1, 1]))])
    return np.array([float(np.arctan2(R[2, 1], R[2, 2])), pitch, float(np.arctan2(R[1, 0], R[0, 0]))])


def small_log3(R: Array) -> Array:
    """Return the rotation vectors (n, 3) [rad] of rotations R (n, 3, 3), quickly if all are below a right angle."""
    cosine = (np.trace(R, axis1=1, axis2=2) - 1) / 2
    if cosine.min(initial=1.0) < 0.0:
        return log3(R)
    along = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1) / 2
    sine = np.linalg.norm(along, axis=1)
    return along * np.where(sine > 0.0, np.arctan2(sine, cosine) / np.maximum(sine, 1e-300), 1.0)[:, None]


def nearest_rotation(H: Array) -> Array:
    """Return the rotations R that maximise tr(Rᵀ H), (..., 3, 3); where H leaves R open, the one nearest to identity.

    Source: Umeyama, IEEE PAMI 13 (1991), eq. 40–43; the open rotations are closed by a small multiple of I.
    """
    size = np.linalg.norm(H, axis=(-2, -1))[..., None, None]
    # 1e-9: weight of "closest to no rotation" where the data leave a rotation open
    U, _, Vt = np.linalg.svd(H + np.maximum(1e-9 * size, 1e-300) * np.eye(3))
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


def fit_circle_in_space(x: Array) -> tuple[Array, Array, float]:
    """Centre (3,), axes (3, 3) with the normal last, and radius of the circle through x (n, 3) [m].

    The plane is that of least squares (SVD), in it the circle of least algebraic error (Kåsa 1976).
    """
    middle = x.mean(axis=0)
    _, _, axes = np.linalg.svd(x - middle, full_matrices=len(x) < 3)
    local = (x - middle) @ axes[:2].T
    A = np.column_stack([2 * local, np.ones(len(x))])
    a, b, c = np.linalg.lstsq(A, (local**2).sum(axis=1))[0]
    return middle + a * axes[0] + b * axes[1], axes, float(np.sqrt(max(c + a * a + b * b, 1e-12)))


def points_on_arc(x: Array, share: Array) -> tuple[Array, float]:
    """Return points (n, 3) [m] at shares (n,) of the arc through x[0], x[1], x[2], x (3, 3), and its length [m]."""
    centre, axes, radius = fit_circle_in_space(x)
    u, v, _ = axes @ (x - centre).T
    first, middle, last = np.arctan2(v, u)
    turn = 1.0 if (middle - first) % (2 * np.pi) < (last - first) % (2 * np.pi) else -1.0
    sweep = (turn * (last - first)) % (2 * np.pi)
    angle = first + turn * sweep * share
    flat = np.column_stack([np.cos(angle), np.sin(angle)]) @ axes[:2]
    return centre + radius * flat, float(radius * sweep)
