"""A circle in space and the fixture from which a bar measures it."""

from dataclasses import dataclass

import numpy as np

from planner.common.units import Array

NEAR_CIRCLE = 0.05  # of the radius: as far off the circle a sample may lie to count as on it


@dataclass(frozen=True)
class CircleAtFixture:
    """A circle, in the base frame, and the ball at the fixed end of the bar.

    Attributes:
        centre: (3,) [m].
        axes: rows are the directions of angle 0 and 90 degrees and the normal, (3, 3).
        radius: [m].
        p_BX: the fixture's ball (3,) [m].
    """

    centre: Array
    axes: Array
    radius: float
    p_BX: Array

    @property
    def height(self) -> float:
        """Of the circle above the fixture, along its normal [m]."""
        return float((self.centre - self.p_BX) @ self.axes[2])

    def polar(self, x: Array) -> tuple[Array, Array]:
        """Angle (n,) [rad] of points x (n, 3) [m], and how far they lie off the circle, (n,) [m]."""
        u, v, height = self.axes @ (x - self.centre).T
        return np.arctan2(v, u), np.asarray(np.hypot(np.hypot(u, v) - self.radius, height))

    def in_plane(self, angle: Array, length: Array) -> Array:
        """Points (n, 2) [m] from the centre, where a bar of this length (n,) [m] ends at angles (n,) [rad]."""
        unit = np.column_stack([np.cos(angle), np.sin(angle)])
        foot = self.axes[:2] @ (self.p_BX - self.centre)
        away = self.radius * unit - foot
        reach = np.sqrt(np.maximum(length**2 - self.height**2, 0.0))
        return np.asarray(foot + away * (reach / np.linalg.norm(away, axis=1))[:, None])
