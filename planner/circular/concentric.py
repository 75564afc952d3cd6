"""Circles through measured points: the least-squares circle, and the two nearest concentric ones that hold them all."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from planner.units import Array, frozen

ROUNDS = 8
BINS = 1440  # angular bins; only the innermost and outermost point of each can touch a circle


@dataclass(frozen=True)
class FittedCircle:
    """A least-squares circle: centre (2,) [m], radius [m], standard deviation of the centre's coordinates (2,) [m]."""

    centre: Array
    radius: float
    std: Array

    def deviation(self, points: Array, radius: float) -> Array:
        """Distances of points (n, 2) [m] from the centre, less ``radius`` [m], (n,)."""
        return np.asarray(np.linalg.norm(points - self.centre, axis=1) - radius)


def fitted(points: Array) -> FittedCircle:
    """Fit a circle to points (n, 2) [m] by least squares of their distances from it (Gauss–Newton, exact)."""
    centre = points.mean(axis=0)
    for _ in range(ROUNDS):
        away = points - centre
        distance = np.linalg.norm(away, axis=1)
        A = np.column_stack([away / distance[:, None], np.ones(len(points))])
        step, *_ = np.linalg.lstsq(A, distance)
        # at the start the centre of an arc is its centroid, far inside; a step is the whole way to the circle's
        centre = centre + step[:2]
        if np.abs(step[:2]).max() < 1e-12:
            break
    distance = np.linalg.norm(points - centre, axis=1)
    radius = float(distance.mean())
    scatter = float(np.sum((distance - radius) ** 2)) / max(len(points) - 3, 1)
    std = np.sqrt(scatter * np.diag(np.linalg.inv(A.T @ A))[:2])
    return FittedCircle(frozen(centre), radius, frozen(std))


def narrowest(points: Array, about: FittedCircle) -> float:
    """Smallest radial separation [m] of two concentric circles that hold points (n, 2) [m] between them.

    The minimum zone of ISO 230-4: a linear programme in the centre's shift and both radii. The centre lies so near to
    that of the least-squares circle that what a shift does to the distances is linear (to shift² / 2 radius).
    """
    away = points - about.centre
    distance = np.linalg.norm(away, axis=1)
    unit = away / distance[:, None]
    rows = _extremes(np.arctan2(unit[:, 1], unit[:, 0]), distance - about.radius)
    r, u = distance[rows] - about.radius, unit[rows]
    size = max(float(np.ptp(r)), 1e-9)
    one = np.ones(len(r))
    # unknowns: shift (2), inner and outer radius, in units of the range: inner <= r - u·shift <= outer
    bounds_on = np.vstack([np.column_stack([u, one, 0 * one]), np.column_stack([-u, 0 * one, -one])])
    right = np.concatenate([r, -r]) / size
    found = linprog([0, 0, -1, 1], A_ub=bounds_on, b_ub=right, bounds=[(None, None)] * 4, method="highs")
    inner, outer = np.asarray(found.x, dtype=float)[2:]
    return float(outer - inner) * size


def _extremes(angle: Array, r: Array) -> np.ndarray:
    """Rows of the smallest and largest value in every angular bin."""
    which = np.floor((angle + np.pi) / (2 * np.pi) * BINS).astype(int)
    order = np.lexsort((r, which))
    ends = np.flatnonzero(np.diff(which[order]) != 0)
    return np.unique(np.concatenate([order[np.append(0, ends + 1)], order[np.append(ends, len(order) - 1)]]))
