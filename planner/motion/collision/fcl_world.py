"""The second collision engine, a judge beside coal: python-fcl with our own forward pass.

Distances of round bodies in closed form, for many states and pairs at once, and lower bounds for all others.

Each body has a core: a segment and a radius whose capsule holds it. For capsules and spheres the core is the body
itself, so their distances are exact. Boxes are bounded along their own axes, and meshes by the core about their
vertices. A search that proves thousands of motions asks a collision engine only where such a bound leaves a doubt.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.common.units import Array
from planner.kinematics.bodies import Body
from planner.kinematics.geometry import bar_state
from planner.motion.collision.engines import CollisionWorld, PairDistances
from planner.motion.collision.scene import Scene, fcl_shape, mesh_faces, outline
from planner.motion.planning_packages import fcl
from planner.motion.tolerances import DISTANCE_SLACK

ROUND = ("capsule", "sphere")


@dataclass(frozen=True)
class Core:
    """The segment between ``ends`` (2, 3) [m] in the carrier's frame, and the ``radius`` [m] about it."""

    ends: Array
    radius: float

    @classmethod
    def of(cls, body: Body) -> Core:
        """Return the body itself where it is round, else a capsule that holds it."""
        centre, z = body.T[:3, 3], body.T[:3, 2]
        if body.kind == "sphere":
            return cls(np.array([centre, centre]), body.size[0])
        if body.kind == "capsule":
            return cls(np.array([centre - z * body.size[1] / 2, centre + z * body.size[1] / 2]), body.size[0])
        return _core_about(outline(body) @ body.T[:3, :3].T + centre)


def _core_about(points: Array) -> Core:
    """A capsule that holds the points (m, 3), along the direction in which they spread most."""
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    axis = np.linalg.eigh(np.cov((points - centre).T))[1][:, -1]
    along = (points - centre) @ axis
    across = np.linalg.norm(points - centre - along[:, None] * axis, axis=1)
    radius = float(across.max())
    cap = np.sqrt(np.maximum(radius**2 - across**2, 0.0))
    low, high = float((along + cap).min()), float((along - cap).max())
    if low > high:  # one ball holds them all
        low = high = (low + high) / 2
    return Core(centre + np.array([[low], [high]]) * axis, radius * (1 + 1e-12))


class RoundBounds:
    """Lower bounds of the distances of a scene's pairs."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.cores = [Core.of(p.body) for p in scene.pieces]
        self._ends = np.array([c.ends for c in self.cores]).reshape(-1, 2, 3)
        self._radius = np.array([c.radius for c in self.cores])
        round_ = np.array([p.body.kind in ROUND for p in scene.pieces], dtype=bool)
        pairs = np.array(scene.pairs, dtype=int).reshape(-1, 2)
        self.exact = round_[pairs].all(axis=1)
        boxed = np.array([p.body.kind == "box" for p in scene.pieces], dtype=bool)[pairs]
        volume = np.array([np.prod(p.body.size) if p.body.kind == "box" else 0.0 for p in scene.pieces])[pairs]
        self.boxed = boxed.any(axis=1)
        swap = self.boxed & (volume[:, 1] > volume[:, 0])  # the larger box comes first
        self.pairs = np.where(swap[:, None], pairs[:, ::-1], pairs)

    def distances(self, q: Array, rows: np.ndarray, columns: np.ndarray) -> Array:
        """Lower bound [m] for each state ``rows`` (m,) of q (n, N) [rad] and pair ``columns`` (m,), (m,).

        The distance itself where :attr:`exact` says so.
        """
        chunk = 16_384  # entries at a time: they stay in the processor's cache
        ends, frames = self._place(q)
        out = np.empty(len(rows))
        radius = self._radius
        for boxed in (False, True):
            mine = np.flatnonzero(self.boxed[columns] == boxed)
            for k in range(0, len(mine), chunk):
                part = mine[k : k + chunk]
                a, b = self.pairs[columns[part]].T
                first, second = (ends[:, :, piece, rows[part]] for piece in (a, b))
                if boxed:
                    out[part] = self._from_box(frames, a, rows[part], second) - radius[b]
                else:
                    out[part] = segment_distance(*first, *second) - radius[a] - radius[b]
        return out

    def _place(self, q: Array) -> tuple[Array, dict[int, tuple[Array, Array]]]:
        """Ends of all cores in the base frame, (2, 3, pieces, n) [m], and the frames of the boxes' carriers."""
        robot, n = self.scene.cell.robot, len(q)
        links = robot.chain.frames(robot.theta(q), robot.link_end)
        x = self.scene.cell.map_position(q) if self.scene.has_bar else np.zeros((n, 3))  # else of no interest
        bar = bar_state(x, self.scene.p_BX).direction.T
        ends, frames = np.empty((2, 3, len(self.cores), n)), dict[int, tuple[Array, Array]]()
        for (carrier, link), carried in self._pieces_by_carrier.items():
            own = self._ends[carried]  # (pieces, 2, 3)
            if carrier in ("housing", "rod"):  # its bodies are round about it
                start = self.scene.p_BX[:, None] if carrier == "housing" else x.T
                ends[:, :, carried] = start[:, None] + own[:, :, 2].T[:, None, :, None] * bar[:, None]
                continue
            R, origin = links[link] if carrier == "link" else (np.eye(3)[:, :, None], np.zeros((3, 1)))
            ends[:, :, carried] = np.einsum("ijm,kej->eikm", R, own) + origin[:, None]
            frames |= {k: (R, origin) for k in carried if self.scene.pieces[k].body.kind == "box"}
        return ends, frames

    @cached_property
    def _pieces_by_carrier(self) -> dict[tuple[str, int], list[int]]:
        """Positions of the pieces that each carrier holds."""
        out: dict[tuple[str, int], list[int]] = {}
        for k, piece in enumerate(self.scene.pieces):
            out.setdefault((piece.carrier, piece.link), []).append(k)
        return out

    def _from_box(
        self, frames: dict[int, tuple[Array, Array]], boxes: np.ndarray, rows: np.ndarray, ends: Array
    ) -> Array:
        """How far the segments ``ends`` (2, 3, m) are at least from boxes (m,) at the states ``rows`` (m,), (m,) [m].

        Along each axis of the box the whole segment stays beyond its face; what is left by all three adds up.
        """
        out = np.empty(len(rows))
        for box in np.unique(boxes):
            mine = np.flatnonzero(boxes == box)
            R, origin = frames[int(box)]
            body = self.scene.pieces[box].body
            if R.shape[2] > 1:
                R = R[:, :, rows[mine]]
            if origin.shape[1] > 1:  # a link that slides moves and does not turn
                origin = origin[:, rows[mine]]
            T_axes = np.einsum("ijm,jk->kim", R, body.T[:3, :3])  # the box's axes in the base frame
            centre = np.einsum("ijm,j->im", R, body.T[:3, 3]) + origin
            inside = np.einsum("kim,eim->ekm", np.broadcast_to(T_axes, (3, 3, len(mine))), ends[:, :, mine] - centre)
            half = np.array(body.size)[:, None] / 2
            beyond = np.maximum(inside.min(axis=0) - half, -half - inside.max(axis=0))
            out[mine] = np.sqrt(np.sum(np.maximum(beyond, 0.0) ** 2, axis=0))
        return out


def segment_distance(p: Array, p_end: Array, r: Array, r_end: Array) -> Array:
    """Distance of the segments p … p_end and r … r_end, each (3, m) [m], (m,); C. Ericson 2005, section 5.1.9."""
    tiny = 1e-30  # [m²] keeps a segment without length from being divided by
    along, other, apart = p_end - p, r_end - r, p - r
    a, e = _dot(along, along), _dot(other, other)
    b, c, f = _dot(along, other), _dot(along, apart), _dot(other, apart)
    safe_a, safe_e = np.maximum(a, tiny), np.maximum(e, tiny)
    s = _clip((b * f - c * e) / np.maximum(a * e - b * b, tiny))
    t = _clip((b * s + f) / safe_e)
    s = _clip((b * t - c) / safe_a)
    gap = apart + s * along - t * other
    return np.asarray(np.sqrt(_dot(gap, gap)))


def _dot(u: Array, v: Array) -> Array:
    return np.asarray(u[0] * v[0] + u[1] * v[1] + u[2] * v[2])


def _clip(share: Array) -> Array:
    return np.asarray(np.minimum(np.maximum(share, 0.0), 1.0))


class ScreenedDistances(PairDistances):
    """An ``engine`` that is asked only where :class:`RoundBounds` leaves a doubt: boxes and meshes that come near."""

    def __init__(self, engine: CollisionWorld) -> None:
        self.engine, self.scene = engine, engine.scene

    @cached_property
    def bounds(self) -> RoundBounds:
        """The closed forms."""
        return RoundBounds(self.scene)

    def pair_distances(self, q: Array, rows: np.ndarray, columns: np.ndarray, enough: Array | None = None) -> Array:
        """Distances (m,) [m] of some pairs, see :class:`PairDistances`."""
        if len(rows) == 0:
            return np.zeros(0)
        found = self.bounds.distances(q, rows, columns)
        wanted = np.inf if enough is None else enough
        doubt = np.flatnonzero(~self.bounds.exact[columns] & ~(found >= wanted))
        if len(doubt):
            states, own = np.unique(rows[doubt], return_inverse=True)
            found[doubt] = self.engine.pair_distances(q[states], own, columns[doubt])
        return found


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
