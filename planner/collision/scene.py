"""Which bodies there are, what carries each, and which pairs may meet: one list for both collision engines."""

from dataclasses import dataclass, replace

import numpy as np

from planner.bodies import Body, capsule
from planner.cell import Cell
from planner.collision.gauges import artifact, beam, tips
from planner.collision.pieces import Piece, reach_of
from planner.units import Array, frozen

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
    pieces: tuple[Piece, ...]
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
    pieces = [Piece(b, "link", link, reach_of(b), of_robot=True) for link, b in robot.bodies]
    tool = [replace(b, T=frozen(T_LF @ b.T)) for b in cell.tool.bodies]
    pieces += [Piece(b, "link", n, reach_of(b)) for b in tool]
    tip = [replace(b, T=frozen(T_LF @ b.T)) for b in tips(cell)]
    pieces += [Piece(b, "link", n, reach_of(b), tip=True) for b in tip]
    pieces += [Piece(b, "world", 0, reach_of(b)) for b in (*cell.obstacles, *_floor(cell))]
    pieces += artifact(cell)
    if cell.gauge.is_bar:
        housing, rod = _bar(cell)
        pieces += [Piece(housing, "housing", 0, reach_of(housing)), Piece(rod, "rod", 0, reach_of(rod))]
    elif cell.gauge.kind == "tracker":
        pieces.append(beam(cell))
    never = robot.never_meet
    pairs = [
        (a, b) for a in range(len(pieces)) for b in range(a + 1, len(pieces)) if _may_meet(pieces[a], pieces[b], never)
    ]
    return Scene(cell, tuple(pieces), tuple(pairs), cell.fixtures[fixture].p_BX)


def _floor(cell: Cell) -> list[Body]:
    if cell.base.floor is None:
        return []
    T = np.eye(4)
    T[2, 3] = cell.base.floor - FLOOR_THICKNESS / 2
    return [Body("floor", "box", (FLOOR_SIZE, FLOOR_SIZE, FLOOR_THICKNESS), frozen(T))]


def _bar(cell: Cell) -> tuple[Body, Body]:
    """Housing along z from the fixture's ball, rod along −z from the MAP's ball, together always the whole bar."""
    g = cell.gauge
    rod_length = min(g.length_max - g.housing, g.length_min - g.trim)
    housing_length = max(g.housing, g.length_max - rod_length)
    z = np.array([0.0, 0.0, 1.0])
    housing = capsule(
        "bar housing", z * (g.trim + g.radius), z * max(housing_length - g.radius, g.trim + g.radius), g.radius
    )
    rod_from = max(rod_length - g.rod_radius, g.trim + g.rod_radius)
    return housing, capsule("bar rod", -z * (g.trim + g.rod_radius), -z * rod_from, g.rod_radius)


def _may_meet(a: Piece, b: Piece, never: frozenset[tuple[int, int]]) -> bool:
    if a.of_bar or b.of_bar:
        return not (a.of_bar and b.of_bar)
    if a.carrier == "world" or b.carrier == "world":
        moving = b if a.carrier == "world" else a
        return moving.carrier == "link" and moving.link > 0
    own = a.of_robot and b.of_robot and (min(a.link, b.link), max(a.link, b.link)) in never
    return abs(a.link - b.link) > 1 and not own
