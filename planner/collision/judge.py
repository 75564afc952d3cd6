"""The second judge: python-fcl with our own forward pass, sharing neither kinematics nor distance code with coal."""

import fcl
import numpy as np

from planner.chain import Chain
from planner.collision.pieces import Piece
from planner.collision.scene import Scene
from planner.collision.shapes import fcl_shape
from planner.gauge import bar_state
from planner.units import Array


class FclJudge:
    """Distances of all checked pairs of a scene by fcl."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._objects = [fcl.CollisionObject(fcl_shape(p.body), fcl.Transform()) for p in scene.pieces]
        self._request = fcl.DistanceRequest(enable_nearest_points=False)

    def distances(self, q: Array) -> Array:
        """Distance of every pair at controller angles q (n, N) [rad], (n, pairs) [m]; ≤ 0 where they overlap."""
        poses = [self._poses(piece, q) for piece in self.scene.pieces]
        out = np.empty((len(q), len(self.scene.pairs)))
        for i in range(len(q)):
            for obj, T in zip(self._objects, poses, strict=True):
                obj.setTransform(fcl.Transform(T[i, :3, :3], T[i, :3, 3]))
            for k, (a, b) in enumerate(self.scene.pairs):
                out[i, k] = fcl.distance(self._objects[a], self._objects[b], self._request, fcl.DistanceResult())
        return out

    def _poses(self, piece: Piece, q: Array) -> Array:
        """Pose of one piece in the base frame, (n, 4, 4)."""
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
        return T @ piece.body.T


def _frames_along(direction: Array) -> Array:
    """Any rotations (n, 3, 3) whose z points along the unit vectors (n, 3): the bar's bodies are round."""
    helper = np.where(np.abs(direction[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    x = np.cross(helper, direction)
    x /= np.linalg.norm(x, axis=1)[:, None]
    return np.stack([x, np.cross(direction, x), direction], axis=2)
