"""The cell in space: bodies that move with the state, the gauge's shell, poses and path; page and print draw the same.

Everything here is in millimetres: it is only looked at.
"""

from dataclasses import dataclass

import numpy as np

from planner.bodies import turn_z_to
from planner.cell import Cell
from planner.chain import Chain
from planner.collision import Piece, build_scene
from planner.gauge import bar_state
from planner.plan import Drive, Plan
from planner.report.data import driven
from planner.report.picture import ORANGE
from planner.report.shapes import Mesh, body_mesh, cap, joined
from planner.report.words import seconds
from planner.units import Array, to_deg, to_mm

FRAMES = 480  # states along the way there, shared by the fixtures
CLOUD = 2500  # candidates shown
LINKS = ("#D8D5CF", "#C3C0B9")  # neighbouring links are told apart by their shade
TOOL, HOUSING, ROD, STAND = "#6B6B6B", ORANGE, "#303030", "#A89F91"


@dataclass(frozen=True)
class Moving:
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
class Frames:
    """States that the slider goes through: ``poses`` of the carriers (f, C, 3, 4) [mm], and what is said of each."""

    poses: Array
    labels: tuple[str, ...]


@dataclass(frozen=True)
class Spot:
    """A measuring pose in space: position (3,) [mm], role, and what is said of it."""

    position: Array
    role: str
    label: str


@dataclass(frozen=True)
class Stage:
    """All that the view shows; lengths in mm.

    Attributes:
        moving: robot, tool and the two parts of the bar.
        standing: bodies that stand, with the base.
        shells: inner and outer limit of the bar's reach within the fixture's cone, of every fixture.
        cloud: candidates' tool points, (c, 3).
        paths, ways: tool point along each measuring path, and along the way to it without the bar.
        spots: measuring poses.
        low, high: corners of the box that holds it all, (3,).
        near_low, near_high: corners of the box around the shells, (3,).
    """

    moving: tuple[Moving, ...]
    standing: Mesh | None
    shells: tuple[Mesh, ...]
    cloud: Array
    paths: tuple[Array, ...]
    ways: tuple[Array, ...]
    spots: tuple[Spot, ...]
    frames: Frames
    floor: float | None
    low: Array
    high: Array
    near_low: Array
    near_high: Array


def build_stage(plan: Plan) -> Stage:
    """Collect what the view shows of a plan."""
    cell, drives = plan.cell, plan.drives
    parts = [_frames(cell, d, FRAMES // len(drives)) for d in drives]
    frames = Frames(np.vstack([p.poses for p in parts]), tuple(label for p in parts for label in p.labels))
    thin = plan.pool.take(np.linspace(0, len(plan.pool) - 1, min(CLOUD, len(plan.pool))).astype(int))
    return staged(
        cell,
        frames,
        cloud=np.vstack([to_mm(cell.at(d.fixture).map_position(thin.q[thin.fixture == d.fixture])) for d in drives]),
        paths=tuple(to_mm(cell.at(d.fixture).map_position(driven(cell, d).motion.q)) for d in drives),
        ways=tuple(to_mm(cell.at(d.fixture).map_position(d.course.travel_trajectory.sample(0.05).q)) for d in drives),
        spots=tuple(s for d in drives for s in _spots(cell, d)),
    )


def staged(
    cell: Cell,
    frames: Frames,
    cloud: Array,
    paths: tuple[Array, ...],
    ways: tuple[Array, ...],
    spots: tuple[Spot, ...],
) -> Stage:
    """Put what moves among what stands, in boxes that hold it all; points in mm."""
    pieces = build_scene(cell).pieces
    moving, shells = _moving(cell, pieces), _shells(cell)
    standing = [body_mesh(p.body) for p in pieces if p.carrier == "world" and p.body.name != "floor"]
    seen = [m.at(poses) for m in moving for poses in frames.poses[:: max(1, len(frames.poses) // 12)]]
    corners = np.vstack([*seen, *paths, *ways, *(s.vertices for s in shells)])
    near = np.vstack([s.vertices for s in shells] or [s.position for s in spots])
    return Stage(
        moving=moving,
        standing=_mm(joined(standing)) if standing else None,
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


def _moving(cell: Cell, pieces: tuple[Piece, ...]) -> tuple[Moving, ...]:
    """Group the moving pieces by look; carriers are links 0 … N, then the housing, then the rod."""
    robot = [p for p in pieces if p.of_robot]
    tool = [p for p in pieces if p.carrier == "link" and not p.of_robot]
    bar = [p for p in pieces if p.of_bar]
    groups = (
        ("robot", robot, [LINKS[p.link % 2] for p in robot]),
        ("tool", tool, [TOOL] * len(tool)),
        ("bar", bar, [HOUSING if p.carrier == "housing" else ROD for p in bar]),
    )
    carrier = {"housing": cell.robot.n_joints + 1, "rod": cell.robot.n_joints + 2}
    return tuple(_group(name, parts, colours, carrier) for name, parts, colours in groups if parts)


def _group(name: str, pieces: list[Piece], colours: list[str], carrier: dict[str, int]) -> Moving:
    meshes = [_mm(body_mesh(p.body)) for p in pieces]
    which = np.repeat([carrier.get(p.carrier, p.link) for p in pieces], [len(m.vertices) for m in meshes])
    painted = tuple(c for c, m in zip(colours, meshes, strict=True) for _ in m.triangles)
    return Moving(name, joined(meshes), which, painted)


def _frames(cell: Cell, drive: Drive, count: int) -> Frames:
    """Poses of all carriers along the way there, and a line of text for each."""
    way = driven(cell, drive, count)
    name = f"fixture {cell.place_name(drive.fixture)}   " if len(cell.fixtures) > 1 else ""
    upcoming = np.clip(np.searchsorted(way.passed, way.motion.t - 1e-9), 0, len(drive.visits) - 1)
    labels = tuple(
        f"{name}{seconds(t)}   towards pose {drive.visits[k].id} ({drive.visits[k].role})   "
        + (f"bar {to_mm(length):.1f} mm   " if cell.gauge.is_bar else "")
        + f"axes {'  '.join(f'{a:.1f}' for a in to_deg(q))} deg"
        for t, k, length, q in zip(way.motion.t, upcoming, way.length, way.motion.q, strict=True)
    )
    return Frames(carrier_poses(cell, drive.fixture, way.motion.q), labels)


def carrier_poses(cell: Cell, fixture: int, q: Array) -> Array:
    """Poses of links 0 … N, housing and rod at controller angles q (n, N) [rad], (n, N + 3, 3, 4) [mm]."""
    robot, p_BX = cell.robot, cell.fixtures[fixture].p_BX
    out = np.zeros((len(q), robot.n_joints + 3, 3, 4))
    for link, end in enumerate(robot.link_end):
        motion = Chain(robot.transforms[:end]).forward(robot.theta(q))
        out[:, link, :, :3], out[:, link, :, 3] = np.moveaxis(motion.R, 2, 0), to_mm(motion.x.T)
    x = cell.at(fixture).map_position(q)
    along = np.array([turn_z_to(d) for d in bar_state(x, p_BX).direction])
    out[:, -2:, :, :3] = along[:, None]
    out[:, -2, :, 3], out[:, -1, :, 3] = to_mm(p_BX), to_mm(x)
    return out


def _shells(cell: Cell) -> tuple[Mesh, ...]:
    g = cell.gauge
    if not g.is_bar:
        return ()
    radii = (g.length_min, g.length_max)
    cups = [f for f in cell.fixtures if f.point == 0]
    return tuple(_mm(cap(f.p_BX, f.axis_B, r, g.cone_fixture)) for f in cups for r in radii)


def _spots(cell: Cell, drive: Drive) -> list[Spot]:
    x = to_mm(cell.at(drive.fixture).map_position(np.array([v.q for v in drive.visits])))
    return [
        Spot(p, v.role, f"pose {v.id}, {v.role}" + (f": {to_mm(v.length):.1f} mm" if cell.gauge.is_bar else ""))
        for p, v in zip(x, drive.visits, strict=True)
    ]


def _mm(mesh: Mesh) -> Mesh:
    return Mesh(to_mm(mesh.vertices), mesh.triangles)
