"""The second collision engine, a judge beside coal: python-fcl with our own forward pass."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from planner.common.units import Array
from planner.kinematics.bodies import Body
from planner.kinematics.geometry import bar_state
from planner.motion.collision.engines import PairDistances
from planner.motion.collision.round_bounds import ROUND, RoundBounds
from planner.motion.collision.scene import Scene, fcl_shape, mesh_faces
from planner.motion.planning_packages import fcl
from planner.motion.tolerances import DISTANCE_SLACK


class FclWorld(PairDistances):
    """The second judge: python-fcl with our own forward pass, its distances made safe.

    fcl's distance of boxes was seen to be far too large now and then (by 0.2 m at worst), while its collision test
    never erred. So a distance counts as far as the plane between the two nearest points proves it: convex bodies lie
    on either side of it, each as far as its own support function says. Where that lacks more than
    ``DISTANCE_SLACK``, and for meshes that are not convex, a distance d counts only if one of the two bodies, grown by
    d, does not collide with the other. Else the largest that holds is searched.

    Where a lower bound will do, pairs whose :class:`RoundBounds` say enough are not asked for, but for the nearest pair
    of every state. Coal's verdict, which asks for all, stands beside it.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        bodies = [p.body for p in scene.pieces]
        self._objects = [fcl.CollisionObject(fcl_shape(b), fcl.Transform()) for b in bodies]
        self._solids = [
            fcl.CollisionObject(_convex_shape(b), fcl.Transform()) if b.kind == "mesh" and b.hull else o
            for b, o in zip(bodies, self._objects, strict=True)
        ]
        self._convex = [b.kind != "mesh" or b.hull for b in bodies]
        self._round = [b.kind in ROUND for b in bodies]
        self._request = fcl.DistanceRequest(enable_nearest_points=True)

    def pair_distances(self, q: Array, rows: np.ndarray, columns: np.ndarray, enough: Array | None = None) -> Array:
        """Distances (m,) [m] of some pairs, see :class:`PairDistances`; the smallest of each state is no bound."""
        if not len(rows):
            return np.zeros(0)
        poses, least = self._poses(q), np.full(len(rows), -np.inf)
        if enough is not None:
            least = self._bounds.distances(q, rows, columns)
        out, along = self._look(rows, columns, poses, least, least if enough is None else enough)
        for p in np.unique(columns):
            a, b = self.scene.pairs[p]
            if self._round[a] and self._round[b]:
                continue
            asked = np.flatnonzero((columns == p) & np.isfinite(along[:, 0]) & (out > 0.0))
            states, gap = rows[asked], np.full(len(asked), -np.inf)
            if self._convex[a] and self._convex[b]:
                n = along[asked]
                gap = -self._support(a, n, poses[a][states]) - self._support(b, -n, poses[b][states])
            proven = out[asked] - gap < DISTANCE_SLACK
            out[asked[proven]] = gap[proven]
            for k in asked[~proven]:
                self._place(self._objects, {a, b}, poses, int(rows[k]))
                out[k] = self._safe_growth(a, b)
        return out

    def _look(
        self, rows: np.ndarray, columns: np.ndarray, poses: list[Array], least: Array, limit: Array
    ) -> tuple[Array, Array]:
        """What fcl says of the pairs that ``least`` (m,) leaves in doubt: distances, and unit ways, else NaN (m, 3)."""
        out, along = least.copy(), np.full((len(rows), 3), np.nan)
        row, nearest, placed = -1, np.inf, set[int]()
        for k in np.lexsort((columns, least, rows)).tolist():
            if rows[k] != row:
                row, nearest, placed = int(rows[k]), np.inf, set()
            if least[k] > max(nearest, limit[k]):
                continue
            a, b = self.scene.pairs[columns[k]]
            self._place(self._solids, {a, b} - placed, poses, row)
            placed |= {a, b}
            result = fcl.DistanceResult()
            out[k] = fcl.distance(self._solids[a], self._solids[b], self._request, result)
            along[k] = result.nearest_points[1] - result.nearest_points[0]
            nearest = min(nearest, out[k])
        return out, along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)

    def _place(self, objects: list[fcl.CollisionObject], which: set[int], poses: list[Array], i: int) -> None:
        for k in which:
            objects[k].setTransform(fcl.Transform(poses[k][i][:3, :3], poses[k][i][:3, 3]))

    def _support(self, k: int, along: Array, T: Array) -> Array:
        """How far body k at poses T (n, 4, 4) reaches along unit vectors (n, 3) from the base's origin, (n,) [m]."""
        body, local = self.scene.pieces[k].body, np.einsum("ni,nij->nj", along, T[:, :3, :3])
        centre = np.einsum("ni,ni->n", along, T[:, :3, 3])
        if body.kind == "mesh":
            return np.asarray(centre + (mesh_faces(body)[0] @ local.T).max(axis=0))
        if body.kind == "box":
            return np.asarray(centre + np.abs(local) @ np.array(body.size) / 2)
        straight = body.size[1] / 2 if body.kind == "capsule" else 0.0
        return np.asarray(centre + body.size[0] + straight * np.abs(local[:, 2]))

    def _safe_growth(self, a: int, b: int) -> float:
        """Largest length, their distance at most, that a body can grow by without meeting the other [m]."""
        distance = float(fcl.distance(self._objects[a], self._objects[b], self._request, fcl.DistanceResult()))
        if distance <= 0.0:
            return distance
        if self.scene.pieces[a].body.kind == "mesh" or self._round[b]:
            a, b = b, a
        free, met = 0.0, max(distance - DISTANCE_SLACK, 0.0)
        if not self._meets(a, b, met):
            return met
        for _ in range(14):  # bisections of a distance that was too large: to a ten-thousandth of it
            middle = (free + met) / 2
            free, met = (free, middle) if self._meets(a, b, middle) else (middle, met)
        return free

    def _meets(self, a: int, b: int, by: float) -> bool:
        """Tell whether body a, grown by ``by`` [m], collides with body b."""
        grown, body = self._objects[a], self.scene.pieces[a].body
        if body.kind != "mesh":  # which does not grow: its tree need not be built anew
            grown = fcl.CollisionObject(fcl_shape(body, by), grown.getTransform())
        return bool(fcl.collide(grown, self._objects[b], fcl.CollisionRequest(), fcl.CollisionResult()))

    @cached_property
    def _bounds(self) -> RoundBounds:
        return RoundBounds(self.scene)

    def _poses(self, q: Array) -> list[Array]:
        """Pose of every piece in the base frame, (n, 4, 4) each."""
        robot, scene = self.scene.cell.robot, self.scene
        links = robot.chain.frames(robot.theta(q), robot.link_end)
        carriers: dict[tuple[str, int], Array] = {}
        for carrier, link in {(p.carrier, p.link) for p in scene.pieces}:
            T = carriers[carrier, link] = np.tile(np.eye(4), (len(q), 1, 1))
            if carrier == "link":
                T[:, :3, :3], T[:, :3, 3] = np.moveaxis(links[link][0], 2, 0), links[link][1].T
            elif carrier != "world":
                x = scene.cell.map_position(q)
                T[:, :3, :3] = _frames_along(bar_state(x, scene.p_BX).direction)
                T[:, :3, 3] = scene.p_BX if carrier == "housing" else x
        return [carriers[p.carrier, p.link] @ p.body.T for p in scene.pieces]


def _frames_along(direction: Array) -> Array:
    """Any rotations (n, 3, 3) whose z points along the unit vectors (n, 3): the bar's bodies are round."""
    helper = np.where(np.abs(direction[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    x = np.cross(helper, direction)
    x /= np.linalg.norm(x, axis=1)[:, None]
    return np.stack([x, np.cross(direction, x), direction], axis=2)


def _convex_shape(body: Body) -> fcl.Convex:
    """Return the polytope of a mesh as one solid, many times quicker than the tree of its triangles."""
    vertices, triangles = mesh_faces(body)
    return fcl.Convex(vertices.copy(), len(triangles), np.insert(triangles, 0, 3, axis=1).ravel())
