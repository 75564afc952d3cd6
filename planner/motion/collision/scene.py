"""Which bodies there are, their shapes for both collision engines, what carries each, and which may meet."""

from dataclasses import dataclass, replace
from typing import Literal

import coal
import fcl
import numpy as np

from planner.cell.cell import Cell
from planner.cell.gauge_types import GaugeBody
from planner.common.units import Array, read_only
from planner.kinematics.bodies import Body
from planner.motion.collision.meshes import coal_mesh, mesh_faces
from planner.runs.run import FIRST_MOUNTING, Mounting


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


FLOOR_SIZE, FLOOR_THICKNESS = 20.0, 0.5  # [m]
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

    def without_bar(self) -> "Scene":
        """Return the scene of a robot that travels without the bar."""
        kept = tuple(p for p in self.pairs if not any(self.pieces[k].of_bar for k in p))
        return replace(self, pairs=kept)

    def at_ball(self, ball: int) -> "Scene":
        """Return the scene in which the indicators' tips may touch one ball."""
        touching = (True, ball)
        pairs = [(self.pieces[a], self.pieces[b]) for a, b in self.pairs]
        return self.without({k for k, (a, b) in enumerate(pairs) if touching in ((a.tip, b.ball), (b.tip, a.ball))})

    def without(self, excluded: set[int]) -> "Scene":
        """Return the scene without the pairs at the positions ``excluded``."""
        return replace(self, pairs=tuple(p for k, p in enumerate(self.pairs) if k not in excluded))

    def pair_name(self, k: int) -> str:
        """Return the two bodies of pair ``k`` as a person calls them."""
        a, b = self.pairs[k]
        return f"{self.pieces[a].body.name} and {self.pieces[b].body.name}"


def build_scene(cell: Cell, mounting: Mounting = FIRST_MOUNTING) -> Scene:
    """Collect the bodies of robot, tool, bar, floor and obstacles, and the pairs that can meet.

    Neighbouring links, bodies that do not move against each other, and the two parts of the bar are left out.
    """
    cell = cell.at(mounting)
    robot, n = cell.robot, cell.robot.n_joints
    T_LF = np.array(robot.flange_frame().homogeneous)
    pieces = [SceneBody(b, "link", link, body_reach(b), of_robot=True) for link, b in robot.bodies]
    tool = [replace(b, T=read_only(T_LF @ b.T)) for b in cell.tool.bodies]
    pieces += [SceneBody(b, "link", n, body_reach(b)) for b in tool]
    brought = cell.gauge.bodies(cell)
    pieces += [_gauge_body(b, T_LF, n) for b in brought if b.carrier == "flange"]
    pieces += [SceneBody(b, "world", 0, body_reach(b)) for b in (*cell.obstacles, *_floor_body(cell))]
    pieces += [_gauge_body(b, T_LF, n) for b in brought if b.carrier != "flange"]
    never = robot.never_meet
    pairs = [
        (a, b) for a in range(len(pieces)) for b in range(a + 1, len(pieces)) if _may_meet(pieces[a], pieces[b], never)
    ]
    return Scene(cell, tuple(pieces), tuple(pairs), cell.fixtures[mounting.fixture].p_BX)


def _floor_body(cell: Cell) -> list[Body]:
    if cell.base.floor is None:
        return []
    T = np.eye(4)
    T[2, 3] = cell.base.floor - FLOOR_THICKNESS / 2
    return [Body(FLOOR, "box", (FLOOR_SIZE, FLOOR_SIZE, FLOOR_THICKNESS), read_only(T))]


def _gauge_body(brought: GaugeBody, T_LF: Array, last: int) -> SceneBody:
    """Hang what the gauge brings to what carries it; T_LF (4, 4): the flange in the last link."""
    body, carrier = brought.body, brought.carrier
    if carrier == "flange":
        body = replace(body, T=read_only(T_LF @ body.T))
        return SceneBody(body, "link", last, body_reach(body), ball=brought.ball, tip=brought.tip)
    return SceneBody(body, carrier, 0, body_reach(body), ball=brought.ball, tip=brought.tip)


def _may_meet(a: SceneBody, b: SceneBody, never: frozenset[tuple[int, int]]) -> bool:
    if a.of_bar or b.of_bar:
        return not (a.of_bar and b.of_bar)
    if a.carrier == "world" or b.carrier == "world":
        moving = b if a.carrier == "world" else a
        return moving.carrier == "link" and moving.link > 0
    own = a.of_robot and b.of_robot and (min(a.link, b.link), max(a.link, b.link)) in never
    return abs(a.link - b.link) > 1 and not own
