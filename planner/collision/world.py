"""Bulk collision checks in C++: pinocchio moves the links, three extra joints move the bar, coal decides."""

import os
from functools import cached_property

import numpy as np
import pinocchio as pin

from planner.cell import Cell
from planner.collision.scene import Scene, build_scene
from planner.collision.shapes import coal_shape
from planner.gauge import bar_state
from planner.units import Array

SAMPLES = 256  # states that decide which pairs of links always overlap
BATCH = 20_000


def available_threads() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)


class CollisionWorld:
    """Robot, tool, bar, floor and obstacles of a cell with one fixture.

    Args:
        scene: the bodies and the pairs that are checked.

    The configuration of the pinocchio model is theta(q), then azimuth, polar angle and length of the bar.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.cell = scene.cell
        self.model, self._geometry = _build(scene)
        self._data, self._geometry_data = self.model.createData(), self._geometry.createData()

    @classmethod
    def from_cell(cls, cell: Cell, fixture: int = 0) -> "CollisionWorld":
        """Build the world; pairs of links that overlap at every sampled state are taken for design, not collision."""
        world = cls(build_scene(cell, fixture))
        return cls(world.scene.without(world._always_overlapping()))

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

    def distances(self, q: Array) -> Array:
        """Distance of every pair, (n, pairs) [m], negative where bodies overlap."""
        out = np.empty((len(q), len(self.scene.pairs)))
        for row, state in zip(out, self.configuration(q), strict=True):
            pin.computeDistances(self.model, self._data, self._geometry, self._geometry_data, state)
            row[:] = [r.min_distance for r in self._geometry_data.distanceResults]
        return out

    @cached_property
    def _pool(self) -> pin.GeometryPool:
        return pin.GeometryPool(self.model, self._geometry, available_threads())

    def _always_overlapping(self) -> set[int]:
        """Positions of pairs of links that overlap at every one of a set of random states."""
        robot, rng = self.cell.robot, np.random.default_rng(0)
        q = np.vstack([self.cell.home, rng.uniform(robot.q_lower, robot.q_upper, (SAMPLES, robot.n_joints))])
        touching = (self.distances(q) < self.cell.motion.clearance).all(axis=0)
        pieces = self.scene.pieces
        return {int(k) for k in np.flatnonzero(touching) if not any(pieces[i].of_bar for i in self.scene.pairs[k])}


def _build(scene: Scene) -> tuple[pin.Model, pin.GeometryModel]:
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
