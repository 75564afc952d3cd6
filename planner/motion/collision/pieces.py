"""One body of a collision scene, what carries it, and its shape for coal and fcl."""

from dataclasses import dataclass
from typing import Literal

import coal
import fcl
import numpy as np

from planner.common.errors import InputError
from planner.common.reading import check_readable
from planner.common.units import Array
from planner.kinematics.bodies import Body


def coal_shape(body: Body) -> coal.CollisionGeometry:
    """Return the coal geometry of a body."""
    if body.kind == "capsule":
        return coal.Capsule(*body.size)
    if body.kind == "sphere":
        return coal.Sphere(*body.size)
    if body.kind == "box":
        return coal.Box(*body.size)
    return load_mesh(body)


def fcl_shape(body: Body) -> fcl.CollisionGeometry:
    """Return the fcl geometry of a body."""
    if body.kind == "capsule":
        return fcl.Capsule(*body.size)
    if body.kind == "sphere":
        return fcl.Sphere(*body.size)
    if body.kind == "box":
        return fcl.Box(*body.size)
    vertices, triangles = mesh_vertices(body)
    model = fcl.BVHModel()
    model.beginModel(len(vertices), len(triangles))
    model.addSubModel(vertices, triangles)
    model.endModel()
    return model


def mesh_vertices(body: Body) -> tuple[Array, np.ndarray]:
    """Return vertices (m, 3) [m] and triangles (t, 3) of a mesh body."""
    mesh = load_mesh(body)
    triangles = [mesh.tri_indices(k) for k in range(mesh.num_tris)]
    return np.array(mesh.vertices()), np.array([[t[0], t[1], t[2]] for t in triangles])


MOST_TRIANGLES = 50_000  # of one mesh: with 200 000 the second engine takes a second a state
MOST_BYTES = 50_000_000


def load_mesh(body: Body) -> coal.BVHModelBase:
    """Read the mesh of a body, scaled to metres.

    Raises:
        InputError: it is too large, is no mesh, or has no triangle or a vertex that is no number.
    """
    assert body.mesh is not None
    check_readable(body.mesh, MOST_BYTES)
    try:
        mesh = coal.MeshLoader().load(str(body.mesh), np.array(body.scale))
    except (RuntimeError, ValueError) as err:
        raise InputError(f"{body.mesh}: cannot be read as a mesh ({str(err).splitlines()[0]})") from err
    if not 0 < mesh.num_tris <= MOST_TRIANGLES:
        raise InputError(
            f"{body.mesh}: the mesh has {mesh.num_tris} triangles, 1 to {MOST_TRIANGLES} are allowed; reduce it, or "
            "cover the body with boxes and capsules"
        )
    if not np.isfinite(mesh.vertices()).all():
        raise InputError(f"{body.mesh}: the mesh has a vertex that is no finite number")
    return mesh


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
    return float(np.linalg.norm(mesh_vertices(body)[0], axis=1).max())
