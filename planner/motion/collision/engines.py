"""The first collision engine: pinocchio with coal, for bulk checks and as first judge."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from itertools import pairwise

import numpy as np

from planner.cell.cell import Cell
from planner.common.second_process import available_threads
from planner.common.units import Array
from planner.kinematics.geometry import bar_state
from planner.kinematics.robot import Robot, elementary_placement
from planner.motion.collision.scene import Scene, build_scene, coal_shape
from planner.motion.planning_packages import pin
from planner.motion.tolerances import OVERLAP_STATES
from planner.runs.run import FIRST_MOUNTING, Mounting

UNKNOWN = np.inf  # distance of a pair that was not asked for [m]


class PairDistances(ABC):
    """What measures how far the bodies of a scene's pairs are apart: all of them, or only some at each state."""

    scene: Scene

    @abstractmethod
    def pair_distances(self, q: Array, rows: np.ndarray, columns: np.ndarray, enough: Array | None = None) -> Array:
        """Distances (m,) [m] of the pairs ``columns`` (m,) at the states ``rows`` (m,), ascending, of q (n, N) [rad].

        Not above zero where two bodies overlap; where a lower bound of ``enough`` (m,) [m] will do, it may be that.
        """

    def distances(self, q: Array, mask: np.ndarray | None = None, enough: Array | None = None) -> Array:
        """Distance of every pair, or of those in ``mask`` (n, pairs), (n, pairs) [m]; of others ``UNKNOWN``.

        ``enough`` (n, pairs): see :meth:`pair_distances`.
        """
        out = np.full((len(q), len(self.scene.pairs)), UNKNOWN)
        rows, columns = np.nonzero(np.ones(out.shape, dtype=bool) if mask is None else mask)
        out[rows, columns] = self.pair_distances(q, rows, columns, None if enough is None else enough[rows, columns])
        return out


class CollisionWorld(PairDistances):
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
    def from_cell(cls, cell: Cell, mounting: Mounting = FIRST_MOUNTING) -> CollisionWorld:
        """Build the world of a cell with one fixture."""
        return cls(build_scene(cell, mounting))

    def configuration(self, q: Array) -> Array:
        """Return the pinocchio configurations (n, N + 3) of controller angles q (n, N) [rad].

        The last three numbers place the bar; they are 0 where no checked pair holds a part of it.
        """
        if not self.scene.has_bar:
            return np.column_stack([self.cell.robot.theta(q), np.zeros((len(q), 3))])
        bar = bar_state(self.cell.map_position(q), self.scene.p_BX)
        azimuth = np.arctan2(bar.direction[:, 1], bar.direction[:, 0])
        polar = np.arctan2(np.hypot(bar.direction[:, 0], bar.direction[:, 1]), bar.direction[:, 2])
        return np.column_stack([self.cell.robot.theta(q), azimuth, polar, bar.length])

    def collides(self, q: Array, clearance: float | None = None) -> np.ndarray:
        """Tell which states (n, N) [rad] bring a pair closer than ``clearance`` [m] (default the cell's), (n,) bool."""
        batch = 20_000  # states at a time, over which the work is spread on the processors
        margin = self.cell.motion.clearance if clearance is None else clearance
        for data in self._pool.getGeometryDatas():
            for request in data.collisionRequests:
                request.security_margin = margin
        out = np.empty(len(q), dtype=bool)
        for start in range(0, len(q), batch):
            columns = np.asfortranarray(self.configuration(q[start : start + batch]).T)
            out[start : start + batch] = pin.computeCollisionsInParallel(available_threads(), self._pool, columns, True)
        return out

    def pair_distances(self, q: Array, rows: np.ndarray, columns: np.ndarray, enough: Array | None = None) -> Array:
        """Distances (m,) [m] of some pairs, see :class:`PairDistances`: negative where bodies overlap."""
        ends, pairs, found = np.searchsorted(rows, np.arange(len(q) + 1)).tolist(), columns.tolist(), list[float]()
        geometry, data, measure = self._geometry, self._geometry_data, pin.computeDistance
        for state, own in zip(self.configuration(q), pairwise(ends), strict=True):
            pin.updateGeometryPlacements(self.model, self._data, geometry, data, state)
            found += [measure(geometry, data, k).min_distance for k in pairs[slice(*own)]]
        return np.array(found)

    def find_near(self, q: Array, margin: float) -> np.ndarray:
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
        q = np.vstack([self.cell.home, rng.uniform(robot.q_lower, robot.q_upper, (OVERLAP_STATES, robot.n_joints))])
        left = np.ones((1, len(self.scene.pairs)), dtype=bool)
        for row in q:
            left &= self.distances(row[None], left) < self.cell.motion.clearance
        return [int(k) for k in np.flatnonzero(left)]


def pin_model(robot: Robot) -> tuple[pin.Model, list[tuple[int, pin.SE3]]]:
    """Build the pinocchio model of a robot; its configuration is ``robot.theta(q)``.

    Returns:
        The model, and for link frames 0 … N the parent joint and the placement in it.
    """
    model, placement, joint = pin.Model(), np.eye(4), 0
    frames: list[tuple[int, pin.SE3]] = []
    for k, t in enumerate(robot.transforms):
        while len(frames) < len(robot.link_end) and robot.link_end[len(frames)] == k:
            frames.append((joint, pin.SE3(placement)))
        placement = placement @ elementary_placement(t, t.nominal)
        if t.joint is not None:
            turns = pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ
            slides = pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ
            kind = (turns if t.kind == "rotation" else slides)[t.axis]
            joint = model.addJoint(joint, kind(), pin.SE3(placement), f"joint{t.joint + 1}")
            placement = np.eye(4)
    while len(frames) < len(robot.link_end):
        frames.append((joint, pin.SE3(placement)))
    for (parent, T), link in zip(frames[1:], robot.masses, strict=True):
        if link is not None:
            model.appendBodyToJoint(parent, pin.Inertia(link.mass, np.array(link.com), np.zeros((3, 3))), T)
    return model, frames


def _build_pin_models(scene: Scene) -> tuple[pin.Model, pin.GeometryModel]:
    """Return the pinocchio model with the bar's joints, and the geometry model with the checked pairs."""
    model, frames = pin_model(scene.cell.robot)
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
