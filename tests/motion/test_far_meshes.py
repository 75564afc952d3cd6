"""A vertex that is no number, or a kilometre away, is told by its file and number in every format of meshes."""

import struct

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.kinematics.bodies import Body
from planner.motion.collision.scene import mesh_faces

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))


def words(row):
    return " ".join(repr(float(v)) for v in row)


def binary_stl(v):
    triangles = (struct.pack("<12f", 0, 0, 0, *v[list(face)].ravel()) + b"\0\0" for face in FACES)
    return bytes(80) + struct.pack("<I", len(FACES)) + b"".join(triangles)


def ascii_stl(v):
    loops = ("".join(f"vertex {words(v[k])}\n" for k in face) for face in FACES)
    facets = "".join(f"facet normal 0 0 0\nouter loop\n{loop}endloop\nendfacet\n" for loop in loops)
    return f"solid a\n{facets}endsolid a\n".encode()


def obj(v):
    lines = [*(f"v {words(row)}" for row in v), *("f " + " ".join(str(k + 1) for k in face) for face in FACES)]
    return "\n".join(lines).encode() + b"\n"


def dae(v):
    axes = "".join(f'<param name="{a}" type="float"/>' for a in "XYZ")
    source = (
        f'<source id="p"><float_array id="pa" count="12">{words(v.ravel())}</float_array><technique_common>'
        f'<accessor source="#pa" count="4" stride="3">{axes}</accessor></technique_common></source>'
    )
    faces = " ".join(str(k) for face in FACES for k in face)
    mesh = (
        f'{source}<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="4">'
        f'<input semantic="VERTEX" source="#v" offset="0"/><p>{faces}</p></triangles>'
    )
    scene = '<visual_scene id="s"><node><instance_geometry url="#g"/></node></visual_scene>'
    return (
        '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset><unit meter="1"/>'
        f'<up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g"><mesh>{mesh}</mesh></geometry>'
        f"</library_geometries><library_visual_scenes>{scene}</library_visual_scenes>"
        '<scene><instance_visual_scene url="#s"/></scene></COLLADA>'
    ).encode()


FORMATS = {"binary.stl": binary_stl, "ascii.stl": ascii_stl, "a.obj": obj, "a.dae": dae}


def load(folder, name, x, hull, scale=1.0):
    corners = CORNERS.copy()
    corners[1, 0] = x
    (folder / name).write_bytes(FORMATS[name](corners))
    return mesh_faces(Body("m", "mesh", (), np.eye(4), folder / name, (scale,) * 3, hull))


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("hull", [True, False], ids=["hull", "faces"])
@pytest.mark.parametrize("x", [1e38, -1e38, 1001.0, float("nan"), float("inf")])
def test_a_far_vertex_is_refused(tmp_path, name, hull, x):
    with pytest.raises(InputError, match=rf"{name}: vertex \d of the mesh, of 4, is at .*1000 m is the farthest"):
        load(tmp_path, name, x, hull)


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("hull", [True, False], ids=["hull", "faces"])
def test_what_counts_is_the_place_with_its_scale(tmp_path, name, hull):
    vertices, triangles = load(tmp_path, name, 2000.0, hull, 1e-3)
    assert vertices.max() == pytest.approx(2.0)
    assert len(triangles) == 4
    with pytest.raises(InputError, match="farthest"):
        load(tmp_path, name, 2.0, hull, 1e3)
