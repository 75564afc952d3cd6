"""One body of a collision scene, what carries it, and its shape for coal and fcl."""

from dataclasses import dataclass
from typing import Literal

import coal
import fcl
import numpy as np

from planner.kinematics.bodies import Body
from planner.motion.collision.meshes import coal_mesh, mesh_faces


def coal_shape(body: Body) -> coal.CollisionGeometry:
    """Return the coal geometry of a body."""
    if body.kind == "capsule":
        return coal.Capsule(*body.size)
    if body.kind == "sphere":
        return coal.Sphere(*body.size)
    if body.kind == "box":
        return coal.Box(*body.size)
    return coal_mesh(body)


def fcl_shape(body: Body) -> fcl.CollisionGeometry:
    """Return the fcl geometry of a body."""
    if body.kind == "capsule":
        return fcl.Capsule(*body.size)
    if body.kind == "sphere":
        return fcl.Sphere(*body.size)
    if body.kind == "box":
        return fcl.Box(*body.size)
    vertices, triangles = mesh_faces(body)
    model = fcl.BVHModel()
    model.beginModel(len(vertices), len(triangles))
    model.addSubModel(vertices, triangles)
    model.endModel()
    return model


Carrier = Literal["world", "link", "housing", "rod"]


@dataclass(frozen=True)
class SceneBody:
    """One body and what carries it.

    Attributes:
        body: the shape, in the frame of its carrier.
        carrier: the base frame (``world``), a robot link, or a part of the bar.
        link: which link, where the carrier is one (0 is the base, N carries the tool).
        reach: largest distance of any of its points from the carrier's origin [m].
        of_robot: whether it is the robot's own, not the tool's.
        ball: which ball of an artifact it is, or −1.
        tip: whether it is the tip of an indicator, which may touch the ball that is measured.
    """

    body: Body
    carrier: Carrier
    link: int = 0
    reach: float = 0.0
    of_robot: bool = False
    ball: int = -1
    tip: bool = False

    @property
    def of_bar(self) -> bool:
        """Whether it is a part of the bar, or a tracker's beam: there only while the gauge reads."""
        return self.carrier in ("housing", "rod")


def body_reach(body: Body) -> float:
    """Return the largest distance of a point of the body from the origin of the frame that carries it [m]."""
    centre = float(np.linalg.norm(body.T[:3, 3]))
    if body.kind == "capsule":
        ends = [body.T[:3, 3] + s * body.T[:3, 2] * body.size[1] / 2 for s in (-1, 1)]
        return max(float(np.linalg.norm(e)) for e in ends) + body.size[0]
    if body.kind == "sphere":
        return centre + body.size[0]
    if body.kind == "box":
        return centre + float(np.linalg.norm(body.size)) / 2
    return centre + _mesh_reach(body)


def _mesh_reach(body: Body) -> float:
    return float(np.linalg.norm(mesh_faces(body)[0], axis=1).max())
