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


def to_euler(R: Array, near: Array, sequence: str) -> Array:
    """Return three angles (n, 3) [rad] of R (n, 3, 3), of both spellings and all turns the one nearest to ``near``.

    ``sequence`` is as scipy's: ``ZYZ``, ``ZYX`` about axes that move along, ``xyz`` about fixed ones. Where the second
    angle leaves only a sum or a difference of the others, the first stays as in ``near``.
    """
    if sequence.islower():
        return to_euler(R, near[:, ::-1], sequence[::-1].upper())[:, ::-1]
    i, j, k = ("XYZ".index(axis) for axis in sequence)
    m = 3 - i - j  # the third axis, k itself unless the first one comes again
    s = 1.0 if (j - i) % 3 == 1 else -1.0  # of an even or odd order i, j, m
    if k == i:
        a, c = np.arctan2(R[:, j, i], -s * R[:, m, i]), np.arctan2(R[:, i, j], s * R[:, i, m])
        b = np.arctan2(np.hypot(R[:, i, j], R[:, i, m]), R[:, i, i])
        lost = np.sin(b) < 1e-7
    else:
        a, c = np.arctan2(-s * R[:, j, k], R[:, k, k]), np.arctan2(-s * R[:, i, j], R[:, i, i])
        b = np.arctan2(s * R[:, i, k], np.hypot(R[:, i, i], R[:, i, j]))
        lost = np.cos(b) < 1e-7
    if lost.any():
        turned = Rotation.from_euler(sequence[:2], np.column_stack([near[:, 0], b])).inv().as_matrix() @ R
        a = np.where(lost, near[:, 0], a)
        one, two = (k + 1) % 3, (k + 2) % 3
        c = np.where(lost, np.arctan2(turned[:, two, one], turned[:, one, one]), c)
    first = np.column_stack([a, b, c])
    second = np.column_stack([a + np.pi, (0.0 if k == i else np.pi) - b, c + np.pi])
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
