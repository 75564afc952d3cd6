"""Six-joint arms from plain DH tables, and runs of made-up gauges; shares nothing with the package."""

from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

# d, a [m], alpha [deg]
UR5 = ([0.089159, 0, 0, 0.10915, 0.09465, 0.0823], [0, -0.425, -0.39225, 0, 0, 0], [90, 0, 0, 90, -90, 0])
KR6 = ([0.4, 0, 0, 0.365, 0, 0.08], [0.025, 0.315, 0.035, 0, 0, 0], [-90, 0, -90, 90, -90, 180])
ARMS = (UR5, KR6)


def flange(arm, q):
    """Flange poses p (n, 3), R (n, 3, 3) of joint angles q (n, 6) [rad], standard DH."""
    T = np.broadcast_to(np.eye(4), (len(q), 4, 4))
    for j, (d, a, alpha) in enumerate(zip(*arm, strict=True)):
        c, s = np.cos(q[:, j]), np.sin(q[:, j])
        ca, sa = np.cos(np.radians(alpha)), np.sin(np.radians(alpha))
        A = np.zeros((len(q), 4, 4))
        A[:, 0, 0], A[:, 0, 1], A[:, 0, 2], A[:, 0, 3] = c, -s * ca, s * sa, a * c
        A[:, 1, 0], A[:, 1, 1], A[:, 1, 2], A[:, 1, 3] = s, c * ca, -c * sa, a * s
        A[:, 2, 1], A[:, 2, 2], A[:, 2, 3], A[:, 3, 3] = sa, ca, d, 1.0
        T = T @ A
    return T[:, :3, 3], T[:, :3, :3]


def poses(rng, arm, n):
    """Random flange poses anywhere in the workspace."""
    return flange(arm, rng.uniform(-2.5, 2.5, (n, 6)))


def ball_in(rng, low, high):
    """A random vector with a length between low and high [m]."""
    v = rng.normal(size=3)
    return v / np.linalg.norm(v) * rng.uniform(low, high)


def turned(rng, n=None):
    """Random rotations, any at all."""
    return Rotation.random(n, random_state=int(rng.integers(2**31))).as_matrix()


@cache
def pool(which):
    """60 000 flange poses of random joint angles of the arm ARMS[which]."""
    return flange(ARMS[which], np.random.default_rng(which).uniform(-3.0, 3.0, (60000, 6)))


def shell(rng, which, n, m, X, low=0.3, high=0.52):
    """Flange poses whose point m stands between low and high [m] from X, found among random joint angles.

    The bar's fixture is reached from one side only: X stands well outside of the arm's middle.
    """
    p, R = pool(which)
    x = R @ m + p
    distance = np.linalg.norm(x - X, axis=1)
    keep = rng.permutation(np.flatnonzero((distance > low) & (distance < high) & (x[:, 2] > X[2] - 0.25)))[:n]
    return p[keep], R[keep]
