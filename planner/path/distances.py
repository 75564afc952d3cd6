"""Distances of chosen pairs by either engine, and quick collision answers for few states at a time."""

import fcl
import numpy as np
import pinocchio as pin

from planner.collision import CollisionWorld, FclJudge
from planner.units import Array

UNKNOWN = np.inf  # distance of a pair that was not asked for [m]


class CoalPairs(CollisionWorld):
    """Pinocchio and coal, asked for some pairs only, one state at a time."""

    def wanted(self, q: Array, mask: np.ndarray) -> Array:
        """Distance of the pairs in ``mask`` (n, pairs) at angles q (n, N) [rad], (n, pairs) [m]; others ``UNKNOWN``."""
        out = np.full(mask.shape, UNKNOWN)
        columns = [np.flatnonzero(row).tolist() for row in mask]
        for i, state in enumerate(self.configuration(q)):
            pin.updateGeometryPlacements(self.model, self._data, self._geometry, self._geometry_data, state)
            found = [pin.computeDistance(self._geometry, self._geometry_data, k).min_distance for k in columns[i]]
            out[i, columns[i]] = found
        return out

    def near(self, q: Array, margin: float) -> np.ndarray:
        """Tell which states (n, N) [rad] bring any pair closer than ``margin`` [m], (n,) bool; cheap for few states."""
        if margin != self._margin:
            for request in self._geometry_data.collisionRequests:
                request.security_margin = margin
            self._margin = margin
        arguments = self.model, self._data, self._geometry, self._geometry_data
        return np.array([pin.computeCollisions(*arguments, s, True) for s in self.configuration(q)], dtype=bool)

    _margin: float | None = None


class FclPairs(FclJudge):
    """Python-fcl, asked for some pairs only."""

    def wanted(self, q: Array, mask: np.ndarray) -> Array:
        """Distance of the pairs in ``mask`` (n, pairs) at angles q (n, N) [rad], (n, pairs) [m]; others ``UNKNOWN``."""
        poses = [self._poses(piece, q) for piece in self.scene.pieces]
        out = np.full(mask.shape, UNKNOWN)
        for i, row in enumerate(mask):
            wanted = np.flatnonzero(row)
            used = {k for p in wanted for k in self.scene.pairs[p]}
            for k in used:
                T = poses[k][i]
                self._objects[k].setTransform(fcl.Transform(T[:3, :3], T[:3, 3]))
            for p in wanted:
                a, b = self.scene.pairs[p]
                out[i, p] = fcl.distance(self._objects[a], self._objects[b], self._request, fcl.DistanceResult())
        return out
