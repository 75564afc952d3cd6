"""A mesh of a box is the box: both engines, obstacle and URDF link; a broken mesh file is named."""

import os

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.kinematics.bodies import Body
from planner.motion.collision.engines import CollisionWorld
from planner.motion.collision.fcl_world import FclWorld
from planner.motion.collision.scene import body_reach, mesh_faces, polytope_excess
from planner.motion.collision.surroundings import describe_polytopes

CORNERS = np.array([[x, y, z] for x in (-0.15, 0.15) for y in (-0.2, 0.2) for z in (-0.25, 0.25)])
FACES = [
    (0, 1, 3),
    (0, 3, 2),
    (4, 6, 7),
    (4, 7, 5),
    (0, 4, 5),
    (0, 5, 1),
    (2, 3, 7),
    (2, 7, 6),
    (0, 2, 6),
    (0, 6, 4),
    (1, 5, 7),
    (1, 7, 3),
]


def stl(path, scale=1.0):
    lines = ["solid box"]
    for face in FACES:
        a, b, c = scale * CORNERS[list(face)]
        n = np.cross(b - a, c - a)
        n /= np.linalg.norm(n)
        lines += [f"facet normal {n[0]} {n[1]} {n[2]}", "outer loop"]
        lines += [f"vertex {v[0]} {v[1]} {v[2]}" for v in (a, b, c)]
        lines += ["endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid box", ""]))


def cell_with(tmp_path, obstacle):
    text = load_cell("comau-nj130/edbb").path.read_text()
    path = tmp_path / "cell.toml"
    path.write_text(
        text + "\n[[obstacles]]\nname = 'block'\nrpy_deg = [10, 20, 30]\nat_mm = [700, 1200, 1300]\n" + obstacle
    )
    return load_cell(str(path))


@pytest.mark.slow
def test_a_mesh_keeps_the_distances_of_its_box(tmp_path):
    stl(tmp_path / "box.stl")
    robot = load_cell("comau-nj130/edbb").robot
    q = np.random.default_rng(0).uniform(robot.q_lower, robot.q_upper, (60, 6))
    found = []
    for obstacle in ("kind = 'mesh'\nfile = 'box.stl'\n", "kind = 'box'\nsize_mm = [300, 400, 500]\n"):
        world = CollisionWorld.from_cell(cell_with(tmp_path, obstacle))
        pairs = [k for k in range(len(world.scene.pairs)) if "block" in world.scene.pair_name(k)]
        assert pairs
        found.append((world.distances(q)[:, pairs], world.collides(q), FclWorld(world.scene).distances(q)[:, pairs]))
    mesh, box = found
    apart = box[0] > 1e-3
    np.testing.assert_allclose(mesh[0][apart], box[0][apart], atol=1e-5)
    np.testing.assert_array_equal(mesh[1], box[1])
    assert apart.any()
    assert ((mesh[2] > 0) == (mesh[0] > 0))[np.abs(mesh[0]) > 1e-3].all()


def test_a_file_that_is_no_mesh_is_named(tmp_path):
    (tmp_path / "box.stl").write_text("not a mesh")
    with pytest.raises(InputError, match=r"box\.stl"):
        CollisionWorld.from_cell(cell_with(tmp_path, "kind = 'mesh'\nfile = 'box.stl'\n"))


def test_a_mesh_that_is_missing_is_named(tmp_path):
    with pytest.raises(InputError, match=r"gone\.stl"):
        cell_with(tmp_path, "kind = 'mesh'\nfile = 'gone.stl'\n")


@pytest.mark.slow
def test_a_polytope_holds_its_mesh_and_stands_little_beyond_its_hull(tmp_path):
    stl(tmp_path / "box.stl")
    points = np.random.default_rng(0).normal(size=(4000, 3)) * [0.1, 0.1, 0.3]
    points /= np.maximum(1.0, np.linalg.norm(points / [0.1, 0.1, 0.3], axis=1))[
        :, None
    ]  # an ellipsoid, thousands of faces
    hull = ConvexHull(points)  # an ellipsoid of more than a thousand faces
    faces = "\n".join(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in hull.simplices)
    (tmp_path / "round.obj").write_text("\n".join(f"v {x} {y} {z}" for x, y, z in points) + "\n" + faces + "\n")
    for name, most in (("box.stl", 8), ("round.obj", 600)):
        body = Body(name, "mesh", (), np.eye(4), tmp_path / name, hull=True)
        vertices, triangles = mesh_faces(body)
        corner, a, b = (vertices[triangles[:, k]] for k in range(3))
        normal = np.cross(a - corner, b - corner)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        own = CORNERS if name == "box.stl" else points
        assert len(vertices) <= most
        assert (own @ normal.T - np.einsum("ij,ij->i", normal, corner)).max() < 1e-6
        assert polytope_excess(body) < 3e-3  # of 0.6 m, by 240 faces
    assert len(hull.simplices) > 1000


def test_a_mesh_drawn_far_from_its_own_origin_reaches_no_further_than_where_it_stands(tmp_path):
    (tmp_path / "far.obj").write_text(
        "".join(f"v {x + 3} {y} {z}\n" for x, y, z in CORNERS)
        + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in ConvexHull(CORNERS).simplices)
    )
    T = np.eye(4)
    T[0, 3] = -3.0  # brings it back: some URDFs draw all links where they stand in the whole arm
    for hull in (False, True):
        reach = body_reach(Body("far", "mesh", (), T, tmp_path / "far.obj", hull=hull))
        assert reach == pytest.approx(np.linalg.norm(CORNERS, axis=1).max(), abs=1e-6)


def test_a_polytope_is_never_further_away_than_its_mesh(tmp_path):
    stl(tmp_path / "box.stl")
    robot, found = load_cell("comau-nj130/edbb").robot, []
    q = np.random.default_rng(1).uniform(robot.q_lower, robot.q_upper, (60, 6))
    for hull in ("false", "true"):
        cell = cell_with(tmp_path, f"kind = 'mesh'\nfile = 'box.stl'\nhull = {hull}\n")
        world = CollisionWorld.from_cell(cell)
        pairs = [k for k in range(len(world.scene.pairs)) if "block" in world.scene.pair_name(k)]
        found.append(world.distances(q)[:, pairs])
        assert bool(describe_polytopes(cell)) == (hull == "true")
    apart = found[0] > 1e-3
    np.testing.assert_allclose(found[1][apart], found[0][apart], atol=1e-6)


def test_a_mesh_that_another_one_of_the_same_time_replaced_is_read_anew(tmp_path):
    """As ``cp -p`` or an archive leaves it: the content decides, not the time of the file."""
    path = tmp_path / "box.stl"
    reach = []
    for scale in (1.0, 2.0):
        stl(path, scale)
        os.utime(path, (1e9, 1e9))
        reach.append(np.abs(mesh_faces(Body("box", "mesh", (), np.eye(4), path))[0]).max())
    assert reach == pytest.approx([0.25, 0.5])
