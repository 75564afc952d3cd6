"""Length and direction of a bar between two balls, and angles between directions."""

from dataclasses import dataclass

import numpy as np

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
