"""The cell in space as triangles, points and lines: robot, tool, bar, obstacles, poses and path.

Lengths are in millimetres; collision engines use the exact shapes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from planner.cell.cell import Cell
from planner.common.units import Array, to_deg, to_mm
from planner.kinematics.bodies import Body, rotation_from_z
from planner.kinematics.chain import Chain
from planner.kinematics.geometry import bar_state, pose
from planner.motion.collision.scene import SceneBody, build_scene, mesh_faces
from planner.report.chart import ORANGE, hex_colour
from planner.report.formatting import duration_text
from planner.report.plan_data import sample_drive
from planner.runs.run import Mounting
from planner.session.plan_types import Course, Drive, Plan

FACETS_AROUND = 20  # a capsule
CAP_RINGS = 5  # from the rim of a cap to its pole
BOX_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
# corners of each side, turning left as seen from outside
BOX_SIDES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])


@dataclass(frozen=True)
class Mesh:
    """Triangles: vertices (v, 3) [m] and positions of their corners (t, 3)."""

    vertices: Array
    triangles: np.ndarray

    def move(self, T: Array) -> "Mesh":
        """Return the mesh carried by the pose ``T`` (4, 4)."""
        return Mesh(self.vertices @ T[:3, :3].T + T[:3, 3], self.triangles)


def join_meshes(meshes: list[Mesh]) -> Mesh:
    """Return several meshes as one."""
    start = np.cumsum([0, *[len(m.vertices) for m in meshes]])
    triangles = [m.triangles + k for m, k in zip(meshes, start[:-1], strict=True)]
    return Mesh(np.vstack([m.vertices for m in meshes]), np.vstack(triangles))


def body_mesh(body: Body) -> Mesh:
    """Return the surface of a body in the frame that carries it."""
    if body.kind == "mesh":
        return Mesh(*mesh_faces(body)).move(body.T)
    if body.kind == "box":
        sides = np.vstack([BOX_SIDES[:, :3], BOX_SIDES[:, [0, 2, 3]]])
        # every side has its own corners, so that edges stay sharp when shaded
        return Mesh((BOX_CORNERS * body.size)[sides.ravel()], np.arange(sides.size).reshape(-1, 3)).move(body.T)
    radius, straight = body.size[0], body.size[1] if body.kind == "capsule" else 0.0
    up = np.linspace(-np.pi / 2, 0.0, CAP_RINGS + 1)
    profile_r = radius * np.concatenate([np.cos(up), np.cos(up[::-1])])
    profile_z = np.concatenate([radius * np.sin(up) - straight / 2, -radius * np.sin(up[::-1]) + straight / 2])
    return _turn_profile(profile_r, profile_z).move(body.T)


def sphere_cap(centre: Array, axis: Array, radius: float, opening: float) -> Mesh:
    """Return the part of a sphere around ``centre`` (3,) within ``opening`` [rad] of the unit vector ``axis`` (3,)."""
    polar = np.linspace(0.0, opening, 4 * CAP_RINGS)
    cap = _turn_profile(radius * np.sin(polar), radius * np.cos(polar), 2 * FACETS_AROUND)
    return cap.move(pose(rotation_from_z(axis), centre))


def _turn_profile(r: Array, z: Array, around: int = FACETS_AROUND) -> Mesh:
    """Turn the profile (r, z) about z."""
    angle = np.arange(around) * (2 * np.pi / around)
    ring = np.stack([np.cos(angle), np.sin(angle), np.ones(around)], axis=1)
    vertices = (ring[None] * np.stack([r, r, z], axis=1)[:, None]).reshape(-1, 3)
    row, column = np.divmod(np.arange((len(r) - 1) * around), around)
    a, b = row * around + column, row * around + (column + 1) % around
    return Mesh(vertices, np.vstack([np.stack([a, b, b + around], 1), np.stack([a, b + around, a + around], 1)]))


def lit_colours(mesh: Mesh, colours: tuple[str, ...]) -> Array:
    """Return the colour of each triangle in the light of one far lamp, (t, 3) 0 … 1."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
    light = np.array([0.35, 0.45, 0.82])  # where it comes from: steeply from above, over the left shoulder
    bright = 0.62 + 0.38 * np.abs(normal @ light)  # 0.62: what lies in the shade
    palette = {name: hex_colour(name) / 255 for name in set(colours)}
    return np.asarray(np.array([palette[name] for name in colours]) * bright[:, None])


VIEW_FRAMES = 360  # states along the path there, shared by the fixtures
NO_POINTS: Array = np.empty((0, 3))
LINKS = ("#D8D5CF", "#C3C0B9")  # neighbouring links are told apart by their shade
TOOL, HOUSING, ROD, STAND = "#6B6B6B", ORANGE, "#303030", "#A89F91"


@dataclass(frozen=True)
class MovingBodies:
    """Bodies that move: vertices [mm] in the frames of their carriers, ``carrier`` (v,) of each, colours (t,)."""

    name: str
    mesh: Mesh
    carrier: np.ndarray
    colours: tuple[str, ...]

    def at(self, poses: Array) -> Array:
        """Vertices (v, 3) [mm] where the carriers stand at ``poses`` (C, 3, 4)."""
        T = poses[self.carrier]
        return np.asarray(np.einsum("vij,vj->vi", T[:, :, :3], self.mesh.vertices) + T[:, :, 3])


@dataclass(frozen=True)
class ViewFrames:
    """States that the slider goes through: ``poses`` of the carriers (f, C, 3, 4) [mm], and what is said of each."""

    poses: Array
    labels: tuple[str, ...]


@dataclass(frozen=True)
class ViewPose:
    """A measuring pose in space: position (3,) [mm], role, and what is said of it."""

    position: Array
    role: str
    label: str


@dataclass(frozen=True)
class CellView:
    """All that the view shows; lengths in mm.

    Attributes:
        name: of its picture, and of its place in the page.
        moving: robot, tool and the two parts of the bar.
        standing: bodies that stand, with the base.
        noun: what the gauge is called.
        shells: inner and outer limit of the bar's reach within the fixture's cone, of every fixture.
        cloud: candidates' tool points, (c, 3).
        paths, ways: tool point along each measuring path, and along the path to it without the bar.
        spots: measuring poses.
        low, high: corners of the box that holds it all, (3,).
        near_low, near_high: corners of the box around the shells, (3,).
    """

    moving: tuple[MovingBodies, ...]
    standing: Mesh | None
    noun: str
    shells: tuple[Mesh, ...]
    cloud: Array
    paths: tuple[Array, ...]
    ways: tuple[Array, ...]
    spots: tuple[ViewPose, ...]
    frames: ViewFrames
    floor: float | None
    low: Array
    high: Array
    near_low: Array
    near_high: Array
    name: ClassVar[str] = "view"


@dataclass(frozen=True)
class ShownMotion:
    """A stretch of a session in the view.

    Attributes:
        mounting: at which fixture, and which of the tool's points.
        q: states that the slider goes through, (f, N) [rad].
        told: what is said of each beside its joint angles.
        path: states along the whole of it, (n, N) [rad].
    """

    mounting: Mounting
    q: Array
    told: Sequence[str]
    path: Array


def build_cell_view(plan: Plan) -> CellView:
    """Collect what the view shows of a plan."""
    cell, drives = plan.cell, plan.drives
    thin = plan.pool.take(np.linspace(0, len(plan.pool) - 1, min(2500, len(plan.pool))).astype(int))  # candidates shown
    cloud = [tool_points(cell, d.mounting, thin.q[thin.samples.at_mounting(d.mounting)]) for d in drives]
    shown = [_show_drive(cell, d, VIEW_FRAMES // len(drives)) for d in drives]
    return view_session(cell, plan.courses, shown, [s for d in drives for s in _spots(cell, d)], cloud=np.vstack(cloud))


def view_session(
    cell: Cell,
    courses: Sequence[Course],
    shown: Sequence[ShownMotion],
    spots: Sequence[ViewPose],
    cloud: Array = NO_POINTS,
    way_step: float = 0.05,
) -> CellView:
    """Return the view of a session in which the robot drives what is ``shown``.

    Args:
        cell: where.
        courses: one a mounting of the gauge, with the way there.
        shown: what is driven with the gauge.
        spots: measuring poses.
        cloud: candidates' tool points, (c, 3) [mm].
        way_step: time between two points of a way there [s].
    """
    units = " and ".join(dict.fromkeys(cell.robot.joint_units))
    labels = [
        f"{told}   axes {'  '.join(f'{a:.1f}' for a in angles)} {units}"
        for s in shown
        for told, angles in zip(s.told, to_deg(s.q), strict=True)
    ]
    return compose_cell_view(
        cell,
        ViewFrames(np.vstack([carrier_poses(cell, s.mounting, s.q) for s in shown]), tuple(labels)),
        cloud=cloud,
        paths=tuple(tool_points(cell, s.mounting, s.path) for s in shown),
        ways=tuple(tool_points(cell, c.mounting, c.travel.trajectory.sample(way_step).q) for c in courses),
        spots=tuple(spots),
    )


def tool_points(cell: Cell, mounting: Mounting, q: Array) -> Array:
    """Tool point that the gauge is held at, (n, 3) [mm], at controller angles q (n, N) [rad]."""
    return to_mm(cell.at(mounting).map_position(q))


def compose_cell_view(
    cell: Cell,
    frames: ViewFrames,
    cloud: Array = NO_POINTS,
    paths: tuple[Array, ...] = (),
    ways: tuple[Array, ...] = (),
    spots: tuple[ViewPose, ...] = (),
) -> CellView:
    """Put moving bodies among the standing ones, with the boxes that hold them all; points in mm."""
    pieces = build_scene(cell).pieces
    moving = _group_moving(cell, pieces)
    shells = tuple(_mm(sphere_cap(*surface)) for surface in cell.gauge.reach_surfaces(cell))
    standing = [body_mesh(p.body) for p in pieces if p.carrier == "world" and p.body.name != "floor"]
    # a beam from afar would make the robot small
    framed = [m for m in moving if cell.has_bar() or m.name != cell.gauge.noun]
    seen = [m.at(poses) for m in framed for poses in frames.poses[:: max(1, len(frames.poses) // 12)]]
    corners = np.vstack([*seen, *paths, *ways, *(s.vertices for s in shells)])
    near = np.vstack([s.vertices for s in shells] or [s.position for s in spots] or [corners])
    return CellView(
        moving=moving,
        standing=_mm(join_meshes(standing)) if standing else None,
        noun=cell.gauge.noun,
        shells=shells,
        cloud=cloud,
        paths=paths,
        ways=ways,
        spots=spots,
        frames=frames,
        floor=None if cell.base.floor is None else float(to_mm(cell.base.floor)),
        low=corners.min(axis=0) - 100,
        high=corners.max(axis=0) + 100,
        near_low=near.min(axis=0) - 60,
        near_high=near.max(axis=0) + 60,
    )


def _group_moving(cell: Cell, pieces: tuple[SceneBody, ...]) -> tuple[MovingBodies, ...]:
    """Group the moving pieces by look; carriers are links 0 … N, then the housing, then the rod."""
    noun, robot = cell.gauge.noun, [p for p in pieces if p.of_robot]
    tool = [p for p in pieces if p.carrier == "link" and not p.of_robot]
    bar = [p for p in pieces if p.of_bar]
    groups = (
        ("robot", robot, [LINKS[p.link % 2] for p in robot]),
        ("tool", tool, [TOOL] * len(tool)),
        (noun, bar, [HOUSING if p.carrier == "housing" else ROD for p in bar]),
    )
    carrier = {"housing": cell.robot.n_joints + 1, "rod": cell.robot.n_joints + 2}
    return tuple(_group(name, parts, colours, carrier) for name, parts, colours in groups if parts)


def _group(name: str, pieces: list[SceneBody], colours: list[str], carrier: dict[str, int]) -> MovingBodies:
    meshes = [_mm(body_mesh(p.body)) for p in pieces]
    which = np.repeat([carrier.get(p.carrier, p.link) for p in pieces], [len(m.vertices) for m in meshes])
    painted = tuple(c for c, m in zip(colours, meshes, strict=True) for _ in m.triangles)
    return MovingBodies(name, join_meshes(meshes), which, painted)


def _show_drive(cell: Cell, drive: Drive, count: int) -> ShownMotion:
    """The way there: how far in time, to which pose, and the gauge's length."""
    way = sample_drive(cell, drive, count)
    name = f"fixture {cell.place_name(drive.mounting)}   " if len(cell.mountings) > 1 else ""
    upcoming = np.clip(np.searchsorted(way.passed, way.motion.t - 1e-9), 0, len(drive.visits) - 1)
    told = [
        f"{name}{duration_text(t)}   towards pose {drive.visits[k].id} ({drive.visits[k].role})"
        + (f"   {cell.gauge.noun} {text}" if (text := cell.gauge.length_text(length)) else "")
        for t, k, length in zip(way.motion.t, upcoming, way.length, strict=True)
    ]
    return ShownMotion(drive.mounting, way.motion.q, told, sample_drive(cell, drive).motion.q)


def carrier_poses(cell: Cell, mounting: Mounting, q: Array) -> Array:
    """Poses of links 0 … N, housing and rod at controller angles q (n, N) [rad], (n, N + 3, 3, 4) [mm]."""
    robot, p_BX = cell.robot, cell.fixtures[mounting.fixture].p_BX
    out = np.zeros((len(q), robot.n_joints + 3, 3, 4))
    for link, end in enumerate(robot.link_end):
        motion = Chain(robot.transforms[:end]).forward(robot.theta(q))
        out[:, link, :, :3], out[:, link, :, 3] = np.moveaxis(motion.R, 2, 0), to_mm(motion.x.T)
    x = cell.at(mounting).map_position(q)
    along = np.array([rotation_from_z(d) for d in bar_state(x, p_BX).direction])
    out[:, -2:, :, :3] = along[:, None]
    out[:, -2, :, 3], out[:, -1, :, 3] = to_mm(p_BX), to_mm(x)
    return out


def _spots(cell: Cell, drive: Drive) -> Iterator[ViewPose]:
    x = tool_points(cell, drive.mounting, np.array([v.q for v in drive.visits]))
    for p, v in zip(x, drive.visits, strict=True):
        length = cell.gauge.length_text(v.length)
        yield ViewPose(p, v.role, f"pose {v.id}, {v.role}{f': {length}' if length else ''}")


def _mm(mesh: Mesh) -> Mesh:
    return Mesh(to_mm(mesh.vertices), mesh.triangles)
