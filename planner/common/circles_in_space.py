"""Circles in space: the best one through points, and the arc from a point through a second to a third."""

import numpy as np

from planner.common.units import Array


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
    """Points (n, 3) [m] at shares (n,) of the arc from x[0] through x[1] to x[2], x (3, 3), and its length [m]."""
    centre, axes, radius = fit_circle_in_space(x)
    u, v, _ = axes @ (x - centre).T
    first, middle, last = np.arctan2(v, u)
    turn = 1.0 if (middle - first) % (2 * np.pi) < (last - first) % (2 * np.pi) else -1.0
    sweep = (turn * (last - first)) % (2 * np.pi)
    angle = first + turn * sweep * share
    flat = np.column_stack([np.cos(angle), np.sin(angle)]) @ axes[:2]
    return centre + radius * flat, float(radius * sweep)
