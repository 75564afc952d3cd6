"""Bodies and the gauge's shell as triangles, for pictures only: collision engines use the exact shapes."""

from dataclasses import dataclass

import numpy as np

from planner.bodies import Body, turn_z_to
from planner.collision.shapes import mesh_vertices
from planner.units import Array

AROUND, RINGS = 20, 5  # facets around a capsule, and from the rim of a cap to its pole
BOX_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
BOX_SIDES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])


@dataclass(frozen=True)
class Mesh:
    """Triangles: vertices (v, 3) [m] and positions of their corners (t, 3)."""

    vertices: Array
    triangles: np.ndarray

    def moved(self, T: Array) -> "Mesh":
        """Return the mesh carried by the pose ``T`` (4, 4)."""
        return Mesh(self.vertices @ T[:3, :3].T + T[:3, 3], self.triangles)


def joined(meshes: list[Mesh]) -> Mesh:
    """Return several meshes as one."""
    start = np.cumsum([0, *[len(m.vertices) for m in meshes]])
    triangles = [m.triangles + k for m, k in zip(meshes, start[:-1], strict=True)]
    return Mesh(np.vstack([m.vertices for m in meshes]), np.vstack(triangles))


def body_mesh(body: Body) -> Mesh:
    """Return the surface of a body in the frame that carries it."""
    if body.kind == "mesh":
        return Mesh(*mesh_vertices(body)).moved(body.T)
    if body.kind == "box":
        sides = np.vstack([BOX_SIDES[:, :3], BOX_SIDES[:, [0, 2, 3]]])
        # every side has its own corners, so that edges stay sharp when shaded
        return Mesh((BOX_CORNERS * body.size)[sides.ravel()], np.arange(sides.size).reshape(-1, 3)).moved(body.T)
    radius, straight = body.size[0], body.size[1] if body.kind == "capsule" else 0.0
    up = np.linspace(-np.pi / 2, 0.0, RINGS + 1)
    profile_r = radius * np.concatenate([np.cos(up), np.cos(up[::-1])])
    profile_z = np.concatenate([radius * np.sin(up) - straight / 2, -radius * np.sin(up[::-1]) + straight / 2])
    return _turned(profile_r, profile_z).moved(body.T)


def cap(centre: Array, axis: Array, radius: float, opening: float) -> Mesh:
    """Return the part of a sphere around ``centre`` (3,) within ``opening`` [rad] of the unit vector ``axis`` (3,)."""
    polar = np.linspace(0.0, opening, 4 * RINGS)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = turn_z_to(axis), centre
    return _turned(radius * np.sin(polar), radius * np.cos(polar), 2 * AROUND).moved(T)


def _turned(r: Array, z: Array, around: int = AROUND) -> Mesh:
    """Turn the profile (r, z) about z."""
    angle = np.arange(around) * (2 * np.pi / around)
    ring = np.stack([np.cos(angle), np.sin(angle), np.ones(around)], axis=1)
    vertices = (ring[None] * np.stack([r, r, z], axis=1)[:, None]).reshape(-1, 3)
    row, column = np.divmod(np.arange((len(r) - 1) * around), around)
    a, b = row * around + column, row * around + (column + 1) % around
    return Mesh(vertices, np.vstack([np.stack([a, b, b + around], 1), np.stack([a, b + around, a + around], 1)]))
