"""Neighbourhoods that cover motions and the triangles under blended corners, and are cut in halves."""

from dataclasses import dataclass

import numpy as np

from planner.units import Array


@dataclass(frozen=True)
class Cells:
    """Open neighbourhoods: the hull of K corners each, 2 for an interval of a motion, 3 for a triangle.

    Attributes:
        motion: which motion each belongs to, (n,).
        corners: (n, K, N) [rad].
        place: where each corner lies along its motion, (n, K), 0 … 1.
    """

    motion: np.ndarray
    corners: Array
    place: Array

    @classmethod
    def of(cls, corners: Array) -> "Cells":
        """One cell for each motion with corners (m, K, N) [rad]."""
        m, K, _ = corners.shape
        return cls(np.arange(m), corners, np.tile(np.linspace(0.0, 1.0, K), (m, 1)))

    @property
    def q(self) -> Array:
        """Centres (n, N) [rad]."""
        return np.asarray(self.corners.mean(axis=1))

    @property
    def spokes(self) -> Array:
        """From centre to corners (n, K, N) [rad]; one of the two is enough for an interval."""
        spread = self.corners - self.q[:, None]
        return spread[:, :1] if self.corners.shape[1] == 2 else spread

    def take(self, rows: np.ndarray) -> "Cells":
        """Return the cells ``rows``."""
        return Cells(self.motion[rows], self.corners[rows], self.place[rows])

    def halves(self) -> "Cells":
        """Cut every cell at the middle of its longest edge; the halves of cell i are i and n + i."""
        n, K = self.place.shape
        ends = [(a, b) for a in range(K) for b in range(a + 1, K)]
        length = np.stack([np.abs(self.corners[:, a] - self.corners[:, b]).sum(axis=1) for a, b in ends])
        first, last = np.array(ends)[np.argmax(length, axis=0)].T
        rows = np.arange(n)
        middle = (self.corners[rows, first] + self.corners[rows, last]) / 2
        centre = (self.place[rows, first] + self.place[rows, last]) / 2
        one, two = self.corners.copy(), self.corners.copy()
        one[rows, last], two[rows, first] = middle, middle
        place_one, place_two = self.place.copy(), self.place.copy()
        place_one[rows, last], place_two[rows, first] = centre, centre
        return Cells(np.tile(self.motion, 2), np.concatenate([one, two]), np.concatenate([place_one, place_two]))
