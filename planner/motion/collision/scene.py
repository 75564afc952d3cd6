"""Which bodies there are, what carries each, and which pairs may meet: one list for both collision engines."""

from dataclasses import dataclass, replace

import numpy as np

from planner.cell.cell import Ball, Cell
from planner.cell.workspace import axis_reach
from planner.common.units import Array, read_only
from planner.kinematics.bodies import Body, capsule_between
from planner.motion.collision.pieces import SceneBody, body_reach

SHAFT_LENGTH = 30e-3  # [m] from the MAP to where the channel holds the indicator's shaft: a tip ends there


def indicator_tips(cell: Cell) -> list[Body]:
    """Return the indicators' tips in the flange frame, where they stand when a ball is centred (TriCal paper, 2.1).

    The round end of the capsule stands out of the flat disk by as much as its rim is cut off.
    """
    head = cell.gauge.head
    if head is None:
        return []
    radius, touch = head.tip / 2, min(b.radius for b in cell.balls)
    bodies = []
    for k, axis in enumerate(head.axes_F):
        a, b = (cell.tool.p_FM + axis * s for s in (touch + radius / 2, SHAFT_LENGTH))
        bodies.append(capsule_between(f"tip of indicator {k + 1}", a, b, radius))
    return bodies


def artifact_bodies(cell: Cell) -> list[SceneBody]:
    """Return the artifact's bodies, balls and stems in the base frame, as the cell says that it stands."""
    if not cell.gauge.head:
        return []
    place = cell.fixtures[0]
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = place.R_BX, place.p_BX
    bodies = [replace(b, T=read_only(T @ b.T)) for b in cell.carrier]
    balls = [_ball(b, T) for b in cell.balls]
    stems = [s for b in cell.balls if (s := _stem(b, T)) is not None]
    return [
        *(SceneBody(b, "world", 0, body_reach(b)) for b in (*bodies, *stems)),
        *(SceneBody(b, "world", 0, body_reach(b), ball=k) for k, b in enumerate(balls)),
    ]


def tracker_beam(cell: Cell) -> SceneBody:
    """Return the tracker's beam from the reflector on, past all that the robot can put in its way."""
    assert cell.file.tracker is not None
    radius = cell.file.tracker.beam_radius_mm * 1e-3
    far = float(np.linalg.norm(cell.fixtures[0].p_BX)) - float(
        axis_reach(cell.chain.transforms, cell.robot.n_joints)[0]
    )
    z, start = np.array([0.0, 0.0, 1.0]), cell.gauge.trim + radius
    body = capsule_between("tracker's beam", -z * start, -z * max(far, cell.gauge.length_min, 2 * start), radius)
    return SceneBody(body, "rod", 0, body_reach(body))


def _ball(ball: Ball, T: Array) -> Body:
    place = np.eye(4)
    place[:3, 3] = ball.p_GS
    return Body(f"ball {ball.name}", "sphere", (ball.radius,), read_only(T @ place))


def _stem(ball: Ball, T: Array) -> Body | None:
    """A capsule that begins inside the ball, so that its round end does not stand out of it."""
    if ball.stem is None:
        return None
    way = ball.stem - ball.p_GS
    length = float(np.linalg.norm(way))
    start = min(ball.radius - ball.stem_radius, length)
    body = capsule_between(
        f"stem of ball {ball.name}", ball.p_GS + way / length * max(start, 0.0), ball.stem, ball.stem_radius
    )
    return replace(body, T=read_only(T @ body.T))


FLOOR_SIZE, FLOOR_THICKNESS = 20.0, 0.5  # [m]


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


def build_scene(cell: Cell, fixture: int = 0) -> Scene:
    """Collect the bodies of robot, tool, bar, floor and obstacles, and the pairs that can meet.

    Neighbouring links, bodies that do not move against each other, and the two parts of the bar are left out.
    """
    cell = cell.at(fixture)
    robot, n = cell.robot, cell.robot.n_joints
    T_LF = np.array(robot.flange_frame().homogeneous)
    pieces = [SceneBody(b, "link", link, body_reach(b), of_robot=True) for link, b in robot.bodies]
    tool = [replace(b, T=read_only(T_LF @ b.T)) for b in cell.tool.bodies]
    pieces += [SceneBody(b, "link", n, body_reach(b)) for b in tool]
    tip = [replace(b, T=read_only(T_LF @ b.T)) for b in indicator_tips(cell)]
    pieces += [SceneBody(b, "link", n, body_reach(b), tip=True) for b in tip]
    pieces += [SceneBody(b, "world", 0, body_reach(b)) for b in (*cell.obstacles, *_floor_body(cell))]
    pieces += artifact_bodies(cell)
    if cell.gauge.is_bar:
        housing, rod = _bar_bodies(cell)
        pieces += [SceneBody(housing, "housing", 0, body_reach(housing)), SceneBody(rod, "rod", 0, body_reach(rod))]
    elif cell.gauge.kind == "tracker":
        pieces.append(tracker_beam(cell))
    never = robot.never_meet
    pairs = [
        (a, b) for a in range(len(pieces)) for b in range(a + 1, len(pieces)) if _may_meet(pieces[a], pieces[b], never)
    ]
    return Scene(cell, tuple(pieces), tuple(pairs), cell.fixtures[fixture].p_BX)


def _floor_body(cell: Cell) -> list[Body]:
    if cell.base.floor is None:
        return []
    T = np.eye(4)
    T[2, 3] = cell.base.floor - FLOOR_THICKNESS / 2
    return [Body("floor", "box", (FLOOR_SIZE, FLOOR_SIZE, FLOOR_THICKNESS), read_only(T))]


def _bar_bodies(cell: Cell) -> tuple[Body, Body]:
    """Housing along z from the fixture's ball, rod along −z from the MAP's ball, together always the whole bar."""
    g = cell.gauge
    rod_length = min(g.length_max - g.housing, g.length_min - g.trim)
    housing_length = max(g.housing, g.length_max - rod_length)
    z = np.array([0.0, 0.0, 1.0])
    housing = capsule_between(
        "bar housing", z * (g.trim + g.radius), z * max(housing_length - g.radius, g.trim + g.radius), g.radius
    )
    rod_from = max(rod_length - g.rod_radius, g.trim + g.rod_radius)
    return housing, capsule_between("bar rod", -z * (g.trim + g.rod_radius), -z * rod_from, g.rod_radius)


def _may_meet(a: SceneBody, b: SceneBody, never: frozenset[tuple[int, int]]) -> bool:
    if a.of_bar or b.of_bar:
        return not (a.of_bar and b.of_bar)
    if a.carrier == "world" or b.carrier == "world":
        moving = b if a.carrier == "world" else a
        return moving.carrier == "link" and moving.link > 0
    own = a.of_robot and b.of_robot and (min(a.link, b.link), max(a.link, b.link)) in never
    return abs(a.link - b.link) > 1 and not own
