"""Meshes as both engines see them: as they are, or as a convex polytope around them that is quick to check."""

from functools import lru_cache
from pathlib import Path

import coal
import numpy as np
from scipy.spatial import ConvexHull, HalfspaceIntersection

from planner.common.errors import InputError
from planner.common.files import check_readable
from planner.common.units import Array, read_only
from planner.kinematics.bodies import Body, Vector

MOST_TRIANGLES = 50_000  # of a mesh as it is: with 200 000 the second engine takes a second a state
MOST_BYTES = 50_000_000
MOST_FACES = 240  # of a polytope about a mesh
CLOSE = 1e-3  # [m] that a polytope may stand beyond the hull's faces before it gets more of them
_BATCH = 12  # faces at a time
FLAT = 1e-6  # [m] thickness below which a mesh encloses no space


def mesh_faces(body: Body) -> tuple[Array, np.ndarray]:
    """Return vertices (m, 3) [m] and triangles (t, 3) of a mesh body: of the polytope about it where it says so.

    Raises:
        InputError: it is too large, is no mesh, or has no triangle or a vertex that is no number.
    """
    assert body.mesh is not None
    check_readable(body.mesh, MOST_BYTES)
    return _faces(body.mesh, body.mesh.stat().st_mtime_ns, body.scale, body.hull)


def coal_mesh(body: Body) -> coal.CollisionGeometry:
    """Return the coal geometry of a mesh body; errors as :func:`mesh_faces`."""
    vertices, triangles = mesh_faces(body)
    points, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    points.extend(list(vertices))
    faces.extend([coal.Triangle(*t) for t in triangles.tolist()])
    if body.hull:
        return coal.Convex(points, faces)
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(faces), len(points))
    model.addSubModel(points, faces)
    model.endModel()
    return model


def excess_of_polytope(body: Body) -> float:
    """How far the polytope about a mesh stands beyond the faces of its convex hull [m]."""
    assert body.mesh is not None
    faces = ConvexHull(np.array(_read(body.mesh, body.scale).vertices())).equations
    return max(0.0, float((mesh_faces(body)[0] @ faces[:, :3].T + faces[:, 3]).max()))


@lru_cache(maxsize=256)
def _faces(path: Path, _written: int, scale: Vector, hull: bool) -> tuple[Array, np.ndarray]:
    mesh = _read(path, scale)
    if hull:
        vertices, triangles = _polytope_about(path, np.array(mesh.vertices()))
        return read_only(vertices), triangles
    if mesh.num_tris > MOST_TRIANGLES:
        raise InputError(
            f"{path}: the mesh has {mesh.num_tris} triangles, 1 to {MOST_TRIANGLES} are allowed; say hull = true for "
            "the convex hull, reduce it, or cover the body with boxes and capsules"
        )
    faces = [mesh.tri_indices(k) for k in range(mesh.num_tris)]
    return read_only(mesh.vertices()), np.array([[t[0], t[1], t[2]] for t in faces])


def _read(path: Path, scale: Vector) -> coal.BVHModelBase:
    try:
        mesh = coal.MeshLoader().load(str(path), np.array(scale))
    except (RuntimeError, ValueError) as err:
        raise InputError(f"{path}: cannot be read as a mesh ({str(err).splitlines()[0]})") from err
    if mesh.num_tris == 0:
        raise InputError(f"{path}: the mesh has no triangles")
    if not np.isfinite(mesh.vertices()).all():
        raise InputError(f"{path}: the mesh has a vertex that is no finite number")
    return mesh


def _polytope_about(path: Path, points: Array) -> tuple[Array, np.ndarray]:
    """A convex polytope of few faces that holds all points (m, 3): the hull itself, or cut from a box by its faces.

    The corners that stand furthest beyond the hull are cut off next, each by the face that it stands furthest beyond,
    until none does by more than ``CLOSE``.
    """
    if np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[-1] < FLAT:
        raise InputError(f"{path}: the mesh is flat: give the body as a box")
    hull = ConvexHull(points)
    planes = np.unique(np.round(hull.equations, 9), axis=0)
    if len(planes) <= MOST_FACES:
        return _orient_faces(points[hull.vertices])
    inside = points[hull.vertices].mean(axis=0)
    axes = np.vstack([np.eye(3), -np.eye(3)])
    cuts = np.column_stack([axes, -(points @ axes.T).max(axis=0)])
    while True:
        corners = HalfspaceIntersection(cuts, inside).intersections
        over = corners @ planes[:, :3].T + planes[:, 3]
        far = over.max(axis=1)
        worst = np.unique(over[np.argsort(-far, kind="stable")[:_BATCH]].argmax(axis=1))
        if far.max() < CLOSE or len(cuts) + len(worst) > MOST_FACES:
            return _orient_faces(corners)
        cuts = np.vstack([cuts, planes[worst]])


def _orient_faces(points: Array) -> tuple[Array, np.ndarray]:
    """The convex hull of points (m, 3): vertices (k, 3) and triangles (t, 3), counter-clockwise from outside."""
    hull = ConvexHull(points)
    number = np.full(len(points), -1)
    number[hull.vertices] = np.arange(len(hull.vertices))
    triangles, out = number[hull.simplices], hull.equations[:, :3]
    a, b, c = (points[hull.simplices[:, k]] for k in range(3))
    turned = np.einsum("ij,ij->i", np.cross(b - a, c - a), out) < 0
    triangles[turned] = triangles[turned][:, ::-1]
    return points[hull.vertices], triangles
