"""Distances of chosen pairs by either engine, and quick collision answers for few states at a time."""

from functools import cached_property

import fcl
import numpy as np
import pinocchio as pin

from planner.bodies import Body
from planner.collision import CollisionWorld, FclJudge
from planner.collision.shapes import fcl_shape
from planner.units import Array

UNKNOWN = np.inf  # distance of a pair that was not asked for [m]
SLACK = 1e-5  # [m] that fcl's collision test is given
BISECTIONS = 14  # of a distance that was too large


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
    """Python-fcl, asked for some pairs only, its distances made safe.

    For boxes fcl's distance was seen to be far too large now and then (by 0.2 m at worst), while its collision test
    never erred. So a distance d in which a box or mesh has a part counts only if one of the two bodies, grown by d,
    does not collide with the other; else the largest that holds is searched.
    """

    def wanted(self, q: Array, mask: np.ndarray) -> Array:
        """Distance of the pairs in ``mask`` (n, pairs) at angles q (n, N) [rad], (n, pairs) [m]; others ``UNKNOWN``."""
        out = np.full(mask.shape, UNKNOWN)
        poses = [self._poses(piece, q) for piece in self.scene.pieces] if len(q) else []
        for i, row in enumerate(mask):
            wanted = np.flatnonzero(row)
            for k in {k for p in wanted for k in self.scene.pairs[p]}:
                T = poses[k][i]
                self._objects[k].setTransform(fcl.Transform(T[:3, :3], T[:3, 3]))
            for p in wanted:
                a, b = self.scene.pairs[p]
                found = fcl.distance(self._objects[a], self._objects[b], self._request, fcl.DistanceResult())
                out[i, p] = found if self._round[a] and self._round[b] else self._safe(a, b, found)
        return out

    def _safe(self, a: int, b: int, distance: float) -> float:
        """Largest length, ``distance`` at most, that a body can grow by without meeting the other [m]."""
        if distance <= 0.0:
            return distance
        if self.scene.pieces[a].body.kind == "mesh" or self._round[b]:
            a, b = b, a
        free, met = 0.0, max(distance - SLACK, 0.0)
        if not self._meets(a, b, met):
            return met
        for _ in range(BISECTIONS):
            middle = (free + met) / 2
            free, met = (free, middle) if self._meets(a, b, middle) else (middle, met)
        return free

    def _meets(self, a: int, b: int, by: float) -> bool:
        """Tell whether body a, grown by ``by`` [m], collides with body b."""
        grown = fcl.CollisionObject(grown_shape(self.scene.pieces[a].body, by), self._objects[a].getTransform())
        return bool(fcl.collide(grown, self._objects[b], fcl.CollisionRequest(), fcl.CollisionResult()))

    @cached_property
    def _round(self) -> list[bool]:
        return [p.body.kind in ("capsule", "sphere") for p in self.scene.pieces]


def grown_shape(body: Body, by: float) -> fcl.CollisionGeometry:
    """Return a shape that holds every point within ``by`` [m] of the body; a mesh stays as it is."""
    if body.kind == "capsule":
        return fcl.Capsule(body.size[0] + by, body.size[1])
    if body.kind == "sphere":
        return fcl.Sphere(body.size[0] + by)
    return fcl.Box(*(s + 2 * by for s in body.size)) if body.kind == "box" else fcl_shape(body)
