"""Bodies as coal and fcl shapes."""

import coal
import fcl
import numpy as np

from planner.bodies import Body
from planner.errors import InputError
from planner.units import Array


def coal_shape(body: Body) -> coal.CollisionGeometry:
    """Return the coal geometry of a body."""
    if body.kind == "capsule":
        return coal.Capsule(*body.size)
    if body.kind == "sphere":
        return coal.Sphere(*body.size)
    if body.kind == "box":
        return coal.Box(*body.size)
    return _load(body)


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
    mesh = _load(body)
    triangles = [mesh.tri_indices(k) for k in range(mesh.num_tris)]
    return np.array(mesh.vertices()), np.array([[t[0], t[1], t[2]] for t in triangles])


def _load(body: Body) -> coal.BVHModelBase:
    try:
        return coal.MeshLoader().load(str(body.mesh), np.array(body.scale))
    except (RuntimeError, ValueError) as err:
        raise InputError(f"{body.mesh}: cannot be read as a mesh ({err})") from err
