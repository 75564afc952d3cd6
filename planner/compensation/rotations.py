"""Batched rotations: small turns, frames, and the ways in which robot languages write an orientation."""

import numpy as np
from scipy.spatial.transform import Rotation

from planner.common.units import Array, read_only


def frame(p: Array, R: Array) -> Array:
    """Return transforms (n, 4, 4) from p (n, 3) [m] and R (n, 3, 3)."""
    T = np.zeros((len(p), 4, 4))
    T[:, :3, :3], T[:, :3, 3], T[:, 3, 3] = R, p, 1.0
    return T


def pose_matrix(p: Array, words: Array) -> Array:
    """Return the transform (4, 4) of a position (3,) [m] and three angles [rad] or a quaternion."""
    R = from_abc(words[None]) if len(words) == 3 else from_quaternion(words[None])
    return read_only(frame(p[None], R)[0])


def inverse(T: Array) -> Array:
    """Return the inverse of rigid transforms (..., 4, 4)."""
    out = np.zeros_like(T)
    R = np.swapaxes(T[..., :3, :3], -1, -2)
    out[..., :3, :3] = R
    out[..., :3, 3] = -np.einsum("...ij,...j->...i", R, T[..., :3, 3])
    out[..., 3, 3] = 1.0
    return out


def from_abc(abc: Array) -> Array:
    """Return R (n, 3, 3) of KUKA's A, B, C (n, 3) [rad]: Rz(A) Ry(B) Rx(C)."""
    return np.asarray(Rotation.from_euler("ZYX", abc).as_matrix())


def to_abc(R: Array, near: Array) -> Array:
    """Return A, B, C (n, 3) [rad] of R (n, 3, 3), of both spellings and all turns the one nearest to ``near``.

    At B = ±90° only A ∓ C is determined; there A stays as in ``near``.
    """
    b = np.arctan2(-R[:, 2, 0], np.hypot(R[:, 2, 1], R[:, 2, 2]))
    a, c = np.arctan2(R[:, 1, 0], R[:, 0, 0]), np.arctan2(R[:, 2, 1], R[:, 2, 2])
    lost = np.cos(b) < 1e-7
    if lost.any():
        turned = np.swapaxes(from_abc(np.column_stack([near[:, 0], b, np.zeros(len(b))])), 1, 2) @ R
        a = np.where(lost, near[:, 0], a)
        c = np.where(lost, np.arctan2(turned[:, 2, 1], turned[:, 2, 2]), c)
    first, second = np.column_stack([a, b, c]), np.column_stack([a + np.pi, np.pi - b, c + np.pi])
    both = np.stack([v + 2 * np.pi * np.round((near - v) / (2 * np.pi)) for v in (first, second)])
    best = np.abs(both - near).max(axis=2).argmin(axis=0)
    return np.asarray(both[best, np.arange(len(R))])


def from_quaternion(wxyz: Array) -> Array:
    """Return R (n, 3, 3) of quaternions (n, 4), scalar first as RAPID writes them."""
    return np.asarray(Rotation.from_quat(wxyz[:, [1, 2, 3, 0]]).as_matrix())


def to_quaternion(R: Array, near: Array) -> Array:
    """Return quaternions (n, 4), scalar first, of R (n, 3, 3), of the two signs the one nearest to ``near``."""
    wxyz = np.asarray(Rotation.from_matrix(R).as_quat())[:, [3, 0, 1, 2]]
    flip = np.einsum("ij,ij->i", wxyz, near) < 0
    return np.where(flip[:, None], -wxyz, wxyz)
