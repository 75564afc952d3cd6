"""The two collision engines: pinocchio with coal for bulk checks, python-fcl with our own forward pass as second
judge."""

from functools import cached_property

import fcl
import numpy as np
import pinocchio as pin

from planner.cell.cell import Cell
from planner.common.second_process import available_threads
from planner.common.units import Array
from planner.kinematics.bar_geometry import bar_state
from planner.kinematics.bodies import Body
from planner.kinematics.chain import Chain
from planner.motion.collision.pieces import SceneBody, coal_shape, fcl_shape
from planner.motion.collision.scene import Scene, build_scene
from planner.runs.run import FIRST_MOUNTING, Mounting

OVERLAP_SAMPLES = 256  # states that decide which pairs always overlap
BATCH = 20_000
UNKNOWN = np.inf  # distance of a pair that was not asked for [m]
SLACK = 1e-5  # [m] that fcl's collision test is given
BISECTIONS = 14  # of a distance that was too large


class CollisionWorld:
    """Robot, tool, bar, floor and obstacles of a cell with one fixture.

    Args:
        scene: the bodies and the pairs that are checked.

    The configuration of the pinocchio model is theta(q), then azimuth, polar angle and length of the bar.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.cell = scene.cell
        self.model, self._geometry = _build_pin_models(scene)
        self._data, self._geometry_data = self.model.createData(), self._geometry.createData()

    @classmethod
    def from_cell(cls, cell: Cell, mounting: Mounting = FIRST_MOUNTING) -> "CollisionWorld":
        """Build the world of a cell with one fixture."""
        return cls(build_scene(cell, mounting))

    def without_bar(self) -> "CollisionWorld":
        """Return the world of the robot that travels without the bar."""
        return CollisionWorld(self.scene.without_bar())

    def configuration(self, q: Array) -> Array:
        """Return the pinocchio configurations (n, N + 3) of controller angles q (n, N) [rad]."""
        bar = bar_state(self.cell.map_position(q), self.scene.p_BX)
        azimuth = np.arctan2(bar.direction[:, 1], bar.direction[:, 0])
        polar = np.arctan2(np.hypot(bar.direction[:, 0], bar.direction[:, 1]), bar.direction[:, 2])
        return np.column_stack([self.cell.robot.theta(q), azimuth, polar, bar.length])

    def collides(self, q: Array, clearance: float | None = None) -> np.ndarray:
        """Tell which states (n, N) [rad] bring a pair closer than ``clearance`` [m] (default the cell's), (n,) bool."""
        margin = self.cell.motion.clearance if clearance is None else clearance
        for data in self._pool.getGeometryDatas():
            for request in data.collisionRequests:
                request.security_margin = margin
        out = np.empty(len(q), dtype=bool)
        for start in range(0, len(q), BATCH):
            columns = np.asfortranarray(self.configuration(q[start : start + BATCH]).T)
            out[start : start + BATCH] = pin.computeCollisionsInParallel(available_threads(), self._pool, columns, True)
        return out

    def distances(self, q: Array, mask: np.ndarray | None = None, enough: Array | None = None) -> Array:
        """Distance of every pair, or of those in ``mask`` (n, pairs), (n, pairs) [m]: negative where bodies overlap.

        Pairs that are not asked for are ``UNKNOWN``.
        """
        mask = np.ones((len(q), len(self.scene.pairs)), dtype=bool) if mask is None else mask
        out = np.full(mask.shape, UNKNOWN)
        columns = [np.flatnonzero(row).tolist() for row in mask]
        for i, state in enumerate(self.configuration(q)):
            pin.updateGeometryPlacements(self.model, self._data, self._geometry, self._geometry_data, state)
            found = [pin.computeDistance(self._geometry, self._geometry_data, k).min_distance for k in columns[i]]
            out[i, columns[i]] = found
        return out

    def near(self, q: Array, margin: float) -> np.ndarray:
        """Tell which states (n, N) [rad] bring any pair closer than ``margin`` [m], (n,) bool; cheap for few states."""
        for request in self._geometry_data.collisionRequests:
            request.security_margin = margin
        arguments = self.model, self._data, self._geometry, self._geometry_data
        return np.array([pin.computeCollisions(*arguments, s, True) for s in self.configuration(q)], dtype=bool)

    @cached_property
    def _pool(self) -> pin.GeometryPool:
        return pin.GeometryPool(self.model, self._geometry, available_threads())

    def always_touching(self) -> list[int]:
        """Positions of pairs that are closer than the clearance at home and at every one of a set of random states."""
        robot, rng = self.cell.robot, np.random.default_rng(0)
        q = np.vstack([self.cell.home, rng.uniform(robot.q_lower, robot.q_upper, (OVERLAP_SAMPLES, robot.n_joints))])
        left = np.ones((1, len(self.scene.pairs)), dtype=bool)
        for row in q:
            left &= self.distances(row[None], left) < self.cell.motion.clearance
        return [int(k) for k in np.flatnonzero(left)]


def _build_pin_models(scene: Scene) -> tuple[pin.Model, pin.GeometryModel]:
    """Return the pinocchio model with the bar's joints, and the geometry model with the checked pairs."""
    model, frames = scene.cell.robot.pin_model()
    at_fixture = pin.SE3(np.eye(3), np.array(scene.p_BX))
    azimuth = model.addJoint(0, pin.JointModelRZ(), at_fixture, "bar_azimuth")
    polar = model.addJoint(azimuth, pin.JointModelRY(), pin.SE3.Identity(), "bar_polar")
    length = model.addJoint(polar, pin.JointModelPZ(), pin.SE3.Identity(), "bar_length")
    carriers = {
        "world": (0, pin.SE3.Identity()),
        "housing": (polar, pin.SE3.Identity()),
        "rod": (length, pin.SE3.Identity()),
    }
    geometry = pin.GeometryModel()
    for k, piece in enumerate(scene.pieces):
        joint, T = frames[piece.link] if piece.carrier == "link" else carriers[piece.carrier]
        placement = T * pin.SE3(np.array(piece.body.T))
        geometry.addGeometryObject(
            pin.GeometryObject(f"{k} {piece.body.name}", joint, placement, coal_shape(piece.body))
        )
    for a, b in scene.pairs:
        geometry.addCollisionPair(pin.CollisionPair(a, b))
    return model, geometry


class FclWorld:
    """The second judge: python-fcl with our own forward pass, its distances made safe.

    For boxes fcl's distance was seen to be far too large now and then (by 0.2 m at worst), while its collision test
    never erred. So a distance d in which a box or mesh has a part counts only if one of the two bodies, grown by d,
    does not collide with the other; else the largest that holds is searched.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._objects = [fcl.CollisionObject(fcl_shape(p.body), fcl.Transform()) for p in scene.pieces]
        self._request = fcl.DistanceRequest(enable_nearest_points=False)

    def distances(self, q: Array, mask: np.ndarray | None = None, enough: Array | None = None) -> Array:
        """Distance of every pair, or of those in ``mask`` (n, pairs), at q (n, N) [rad]; others are ``UNKNOWN``.

        (n, pairs) [m]; ≤ 0 where they overlap.
        """
        mask = np.ones((len(q), len(self.scene.pairs)), dtype=bool) if mask is None else mask
        out = np.full(mask.shape, UNKNOWN)
        poses = self._poses(q) if len(q) else []
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
        grown, body = self._objects[a], self.scene.pieces[a].body
        if body.kind != "mesh":  # which does not grow: its tree need not be built anew
            grown = fcl.CollisionObject(inflated_shape(body, by), grown.getTransform())
        return bool(fcl.collide(grown, self._objects[b], fcl.CollisionRequest(), fcl.CollisionResult()))

    @cached_property
    def _round(self) -> list[bool]:
        return [p.body.kind in ("capsule", "sphere") for p in self.scene.pieces]

    def _poses(self, q: Array) -> list[Array]:
        """Pose of every piece in the base frame, (n, 4, 4) each; a link is placed once for all its pieces."""
        placed = {(p.carrier, p.link): p for p in self.scene.pieces}
        carriers = {key: self._carrier_pose(p, q) for key, p in placed.items()}
        return [carriers[p.carrier, p.link] @ p.body.T for p in self.scene.pieces]

    def _carrier_pose(self, piece: SceneBody, q: Array) -> Array:
        T = np.tile(np.eye(4), (len(q), 1, 1))
        robot = self.scene.cell.robot
        if piece.carrier == "link":
            motion = Chain(robot.transforms[: robot.link_end[piece.link]]).forward(robot.theta(q))
            T[:, :3, :3], T[:, :3, 3] = np.moveaxis(motion.R, 2, 0), motion.x.T
        elif piece.of_bar:
            x = self.scene.cell.map_position(q)
            bar = bar_state(x, self.scene.p_BX)
            T[:, :3, :3] = _frames_along(bar.direction)
            T[:, :3, 3] = self.scene.p_BX if piece.carrier == "housing" else x
        return T


def _frames_along(direction: Array) -> Array:
    """Any rotations (n, 3, 3) whose z points along the unit vectors (n, 3): the bar's bodies are round."""
    helper = np.where(np.abs(direction[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    x = np.cross(helper, direction)
    x /= np.linalg.norm(x, axis=1)[:, None]
    return np.stack([x, np.cross(direction, x), direction], axis=2)


def inflated_shape(body: Body, by: float) -> fcl.CollisionGeometry:
    """Return a shape that holds every point within ``by`` [m] of the body; a mesh stays as it is."""
    if body.kind == "capsule":
        return fcl.Capsule(body.size[0] + by, body.size[1])
    if body.kind == "sphere":
        return fcl.Sphere(body.size[0] + by)
    return fcl.Box(*(s + 2 * by for s in body.size)) if body.kind == "box" else fcl_shape(body)
