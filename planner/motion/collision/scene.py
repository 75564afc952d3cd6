"""Which bodies there are, their meshes and shapes for both collision engines, what carries each, which may meet.

How many triangles a mesh has, counted without reading it: what is made of each takes 10 kB.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from hashlib import sha256
from itertools import compress
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial import ConvexHull, HalfspaceIntersection

from planner.cell.cell import Cell
from planner.cell.gauge_types import GaugeBody
from planner.common.errors import InputError
from planner.common.files import read_bytes
from planner.common.units import Array, read_only, to_mm
from planner.kinematics.bodies import Body, Vector
from planner.kinematics.robot import Robot
from planner.kinematics.robot_file import NEXT_BUT_ONE
from planner.motion.planning_packages import coal, fcl
from planner.motion.tolerances import FARTHEST_VERTEX, FLAT_THICKNESS, HULL_TOLERANCE, MOST_TRIANGLES
from planner.runs.run import FIRST_MOUNTING, Mounting


def count_triangles(path: Path) -> int:
    """Return the number of triangles that a mesh has at least; of an unknown format none.

    Raises:
        InputError: it cannot be read, or is too large.
    """
    head, triangle = 84, 50  # bytes of a binary STL
    data = read_bytes(path)
    match path.suffix.lower():
        case ".stl" if data.lstrip()[:5].lower() != b"solid" or b"facet" not in data[:4096]:
            return max(0, len(data) - head) // triangle
        case ".stl":
            return data.lower().count(b"endfacet")
        case ".obj":
            return sum(max(0, len(line.split()) - 3) for line in re.findall(rb"(?m)^[ \t]*f[ \t][^\r\n]*", data))
        case ".dae":
            kinds = rb"<(?:\w+:)?(?:triangles|polylist|polygons)\b[^>]*?\bcount\s*=\s*[\"'](\d{1,12})"
            return sum(map(int, re.findall(kinds, data)))
        case ".ply":
            found = re.search(rb"element\s+face\s+(\d{1,12})", data[:10_000])
            return int(found[1]) if found else 0
    return 0


def mesh_faces(body: Body) -> tuple[Array, np.ndarray]:
    """Return vertices (m, 3) [m] and triangles (t, 3) of a mesh body: of the polytope about it where it says so.

    Raises:
        InputError: it is too large, is no mesh, or has no triangle or a vertex that is no number.
    """
    assert body.mesh is not None
    content = read_bytes(body.mesh, 50_000_000)  # bytes: 50 000 triangles take 2.5 MB as binary STL
    return _faces(body.mesh, sha256(content).digest(), body.scale, body.hull)


HULL_ADVICE = "say hull = true for the convex hull, reduce it, or cover the body with boxes and capsules"


def polytope_excess(body: Body) -> float:
    """How far the polytope about a mesh stands beyond the faces of its convex hull [m]."""
    assert body.mesh is not None
    faces = ConvexHull(np.array(_read(body.mesh, body.scale).vertices())).equations
    return max(0.0, float((mesh_faces(body)[0] @ faces[:, :3].T + faces[:, 3]).max()))


@lru_cache(maxsize=256)
def _faces(path: Path, _content: bytes, scale: Vector, hull: bool) -> tuple[Array, np.ndarray]:
    # 200 000: of a mesh of which the hull alone counts; it takes 2 GB to be read
    most = 200_000 if hull else MOST_TRIANGLES
    if (count := count_triangles(path)) > most:
        advice = "reduce it" if hull else HULL_ADVICE
        raise InputError(f"{path}: the mesh has {count} triangles, 1 to {most} are allowed; {advice}")
    mesh = _read(path, scale)
    if hull:
        vertices, triangles = _polytope_about(path, np.array(mesh.vertices()))
        return read_only(vertices), triangles
    if mesh.num_tris > MOST_TRIANGLES:
        raise InputError(
            f"{path}: the mesh has {mesh.num_tris} triangles, 1 to {MOST_TRIANGLES} are allowed; {HULL_ADVICE}"
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
    far = np.flatnonzero(~(np.abs(mesh.vertices()) <= FARTHEST_VERTEX).all(axis=1))  # what is no number is far too
    if len(far):
        place = ", ".join(f"{v:.4g}" for v in mesh.vertices()[far[0]])
        raise InputError(
            f"{path}: vertex {far[0] + 1} of the mesh, of {len(mesh.vertices())}, is at ({place}) m with its scale, "
            f"and {FARTHEST_VERTEX:g} m is the farthest that is allowed"
        )
    return mesh


def _polytope_about(path: Path, points: Array) -> tuple[Array, np.ndarray]:
    """A convex polytope of few faces that holds all points (m, 3): the hull itself, or cut from a box by its faces.

    The corners that stand furthest beyond the hull are cut off next, each by the face that it stands furthest beyond,
    until none does by more than ``HULL_TOLERANCE``.
    """
    most_faces = 240  # of a polytope about a mesh
    if np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[-1] < FLAT_THICKNESS:
        raise InputError(f"{path}: the mesh is flat: give the body as a box")
    hull = ConvexHull(points)
    planes = np.unique(np.round(hull.equations, 9), axis=0)
    if len(planes) <= most_faces:
        return _orient_faces(points[hull.vertices])
    inside = points[hull.vertices].mean(axis=0)
    axes = np.vstack([np.eye(3), -np.eye(3)])
    cuts = np.column_stack([axes, -(points @ axes.T).max(axis=0)])
    while True:
        corners = HalfspaceIntersection(cuts, inside).intersections
        over = corners @ planes[:, :3].T + planes[:, 3]
        far = over.max(axis=1)
        worst = np.unique(over[np.argsort(-far, kind="stable")[:12]].argmax(axis=1))  # faces at a time
        if far.max() < HULL_TOLERANCE or len(cuts) + len(worst) > most_faces:
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


def coal_shape(body: Body) -> coal.CollisionGeometry:
    """Return the coal geometry of a body; errors as :func:`mesh_faces`."""
    if body.kind == "capsule":
        return coal.Capsule(*body.size)
    if body.kind == "sphere":
        return coal.Sphere(*body.size)
    if body.kind == "box":
        return coal.Box(*body.size)
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


def fcl_shape(body: Body, grown: float = 0.0) -> fcl.CollisionGeometry:
    """Return the fcl geometry of a body and of all within ``grown`` [m] of it; of a mesh alone as it is."""
    if body.kind == "capsule":
        return fcl.Capsule(body.size[0] + grown, body.size[1])
    if body.kind == "sphere":
        return fcl.Sphere(body.size[0] + grown)
    if body.kind == "box":
        return fcl.Box(*(s + 2 * grown for s in body.size))
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
    round_, points = body.kind in ("capsule", "sphere"), outline(body) @ body.T[:3, :3].T + body.T[:3, 3]
    return float(np.linalg.norm(points, axis=1).max()) + (body.size[0] if round_ else 0.0)


def outline(body: Body) -> Array:
    """Return points (m, 3) [m] in the body's own frame. Their hull is the body; of a round body it is the core."""
    if body.kind == "mesh":
        return mesh_faces(body)[0]
    if body.kind == "box":
        return np.stack(np.meshgrid(*[(-0.5, 0.5)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) * body.size
    half = body.size[1] / 2 if body.kind == "capsule" else 0.0
    return np.array([[0.0, 0.0, -half], [0.0, 0.0, half]])


FLOOR = "floor"


@dataclass(frozen=True)
class Scene:
    """All pieces and the pairs that are checked, for one fixture.

    Attributes:
        pieces: every body.
        pairs: positions in ``pieces`` of the two bodies of each checked pair.
        p_BX: position of the fixture in the base frame, (3,) [m].
    """

    cell: Cell
    pieces: tuple[SceneBody, ...]
    pairs: tuple[tuple[int, int], ...]
    p_BX: Array

    @cached_property
    def has_bar(self) -> bool:
        """Whether any checked pair holds a part of the bar."""
        return any(self.pieces[k].of_bar for pair in self.pairs for k in pair)

    def without_bar(self) -> Scene:
        """Return the scene of a robot that travels without the bar."""
        kept = tuple(p for p in self.pairs if not any(self.pieces[k].of_bar for k in p))
        return replace(self, pairs=kept)

    def at_ball(self, ball: int) -> Scene:
        """Return the scene in which the indicators' tips may touch one ball."""
        touching = (True, ball)
        pairs = [(self.pieces[a], self.pieces[b]) for a, b in self.pairs]
        kept = [touching not in ((a.tip, b.ball), (b.tip, a.ball)) for a, b in pairs]
        return replace(self, pairs=tuple(compress(self.pairs, kept)))

    def pair_name(self, k: int) -> str:
        """Return the two bodies of pair ``k`` as a person calls them."""
        a, b = (self.pieces[i].body.name for i in self.pairs[k])
        return f"{a} and {b}"

    def never_meet_key(self, k: int) -> str:
        """Return how ``never_meet`` of ``robot.toml`` names the links of pair ``k``, empty where it cannot."""
        a, b = (self.pieces[i] for i in self.pairs[k])
        if not (a.of_robot and b.of_robot):
            return ""
        if a.body.part and b.body.part:
            return f'["{a.body.part}", "{b.body.part}"]'
        low, high = sorted((a.link, b.link))
        return f"[{low}, {high}]" if high - low == NEXT_BUT_ONE and not (a.body.branch or b.body.branch) else ""

    def describe_pair(self, k: int) -> str:
        """Return the two bodies of pair ``k``, and the key of the cell that places one of them."""
        name, floor = self.pair_name(k), self.cell.base.floor
        has_floor = FLOOR in (self.pieces[i].body.name for i in self.pairs[k])
        return f"{name} (base.floor_mm = {to_mm(floor):g})" if has_floor and floor is not None else name


def advise_never_meet(keys: Sequence[str]) -> str:
    """Say which line of ``robot.toml`` leaves the pairs ``keys`` of links out of every check."""
    return (
        f"name the links in robot.toml (which can name a URDF): never_meet = [{', '.join(keys)}] and never_meet_reason"
    )


def build_scene(cell: Cell, mounting: Mounting = FIRST_MOUNTING) -> Scene:
    """Collect the bodies of robot, tool, bar, floor and obstacles, and the pairs that can meet.

    Neighbouring links of the chain, bodies that do not move against each other, pairs that the robot's files name,
    and the two parts of the bar are left out. What branches off the chain is checked against neighbours too.
    """
    cell = cell.at(mounting)
    robot, n = cell.robot, cell.robot.n_joints
    robot.check_meshes()
    T_LF = robot.flange_frame()
    pieces = [SceneBody(b, "link", link, body_reach(b), of_robot=True) for link, b in robot.bodies]
    tool = [replace(b, T=read_only(T_LF @ b.T)) for b in cell.tool.bodies]
    pieces += [SceneBody(b, "link", n, body_reach(b)) for b in tool]
    brought = cell.gauge.bodies(cell)
    pieces += [_gauge_body(b, T_LF, n) for b in brought if b.carrier == "flange"]
    pieces += [SceneBody(b, "world", 0, body_reach(b)) for b in (*cell.obstacles, *_floor_body(cell))]
    pieces += [_gauge_body(b, T_LF, n) for b in brought if b.carrier != "flange"]
    parts = frozenset(frozenset((one, other)) for one, other, _ in robot.never_meet_parts)
    pairs = [
        (a, b)
        for a in range(len(pieces))
        for b in range(a + 1, len(pieces))
        if _may_meet(pieces[a], pieces[b], robot) and frozenset((pieces[a].body.part, pieces[b].body.part)) not in parts
    ]
    return Scene(cell, tuple(pieces), tuple(pairs), cell.fixtures[mounting.fixture].p_BX)


def _floor_body(cell: Cell) -> list[Body]:
    thickness = 0.5  # [m]
    size = 20.0  # [m] across: wider than any cell
    if cell.base.floor is None:
        return []
    T = np.eye(4)
    T[2, 3] = cell.base.floor - thickness / 2
    return [Body(FLOOR, "box", (size, size, thickness), read_only(T))]


def _gauge_body(brought: GaugeBody, T_LF: Array, last: int) -> SceneBody:
    """Hang what the gauge brings to what carries it; T_LF (4, 4): the flange in the last link."""
    body, carrier = brought.body, brought.carrier
    if carrier == "flange":
        carried = replace(body, T=read_only(T_LF @ body.T))
        return SceneBody(carried, "link", last, body_reach(carried), ball=brought.ball, tip=brought.tip)
    return SceneBody(body, carrier, 0, body_reach(body), ball=brought.ball, tip=brought.tip)


def _may_meet(a: SceneBody, b: SceneBody, robot: Robot) -> bool:
    if a.of_bar or b.of_bar:
        return not (a.of_bar and b.of_bar)
    if a.carrier == "world" or b.carrier == "world":
        moving = b if a.carrier == "world" else a
        return moving.carrier == "link" and moving.link > 0
    if a.link == b.link:
        return False
    if a.of_robot and b.of_robot and (min(a.link, b.link), max(a.link, b.link)) in robot.never_meet:
        return a.body.branch or b.body.branch
    if a.body.rigid and b.body.rigid:
        return frozenset((a.body.rigid, b.body.rigid)) not in robot.neighbours
    return a.body.branch or b.body.branch or abs(a.link - b.link) > 1
