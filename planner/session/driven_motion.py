"""The motion that a neutral program makes the robot drive, recovered from its instructions and nothing else.

How the joints move while the tool runs on circles without turning, as controllers drive them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import NoSolutionError
from planner.common.units import Array, read_only
from planner.kinematics.geometry import fit_circle_in_space, points_on_arc
from planner.kinematics.inverse_kinematics import solve_pose_ik, tool_pose
from planner.programs.instructions import Centre, Entry, JointMove, Pause, Program, StretchBegin, StretchEnd
from planner.runs.run import FIRST_MOUNTING, Mounting
from planner.session.tolerances import CIRCLE_END_OFF, SAME_ANGLE

STEP = np.deg2rad(1.0)  # of a circle between two points at which the joints are found

Angles = tuple[float, ...]
CirclePiece = tuple[Angles, Angles, Angles]
"""Angles where a piece of a circle begins, at a point of it, and where it ends (N,) [deg]."""


def circle_polygons(cell: Cell, pieces: Sequence[CirclePiece]) -> list[list[Angles]]:
    """Return the corners (k, N) [deg] of a polygon about the way of the joints on each piece, its end included.

    Between two points that are found the joints run on a parabola nearly (the rest is below 1e-7 rad), which lies in
    the triangle of the points and the polygon's corner between them.

    Raises:
        NoSolutionError: the joints do not lead round a piece to where it ends.
    """
    if not pieces:
        return []
    ends = np.deg2rad(np.array(pieces))  # (P, 3, N)
    tool = [cell.map_position(e) for e in ends]
    turn = max(points_on_arc(x, np.zeros(1))[1] / fit_circle_in_space(x)[2] for x in tool)
    count = max(8, int(np.ceil(turn / STEP)))  # steps of a piece at least
    x = np.stack([points_on_arc(one, np.linspace(0.0, 1.0, 2 * count + 1))[0] for one in tool], axis=1)
    points = _follow(cell, ends[:, 0], x)
    if not np.abs(points[-1] - ends[:, 2]).max() <= CIRCLE_END_OFF:
        raise NoSolutionError("on a circle the joints do not come to where it ends: the arm would turn its tool")
    corners = np.rad2deg(2 * points[1::2] - (points[:-2:2] + points[2::2]) / 2)
    return [[*map(tuple, corners[:, k].tolist()), piece[2]] for k, piece in enumerate(pieces)]


def _follow(cell: Cell, q: Array, x: Array) -> Array:
    """Return the joints (k, P, N) [rad] from q (P, N) on, with the tool at x (k, P, 3) [m] and never turned."""
    branch = np.deg2rad(20.0)  # that no joint turns from one point to the next, unless the arm passes a singular pose
    R = tool_pose(cell.chain, cell.robot, q)[1]
    out = [q]
    for there in x[1:]:
        guess = out[-1] if len(out) == 1 else 2 * out[-1] - out[-2]
        # 8: rounds of Newton from one point to the next
        found, good = solve_pose_ik(cell.chain, cell.robot, guess, there, R, 8)
        if not good.all() or np.abs(found - out[-1]).max() > branch:
            raise NoSolutionError("the arm does not get round a circle without turning the tool")
        out.append(found)
    return np.array(out)


NO_BALL = -1  # stands for a ball's number where there is none


PlacedCircle = tuple[Mounting, Angles, Angles, Angles]
"""At which mounting a piece of a circle is driven, and its angles as :data:`CirclePiece` has them [deg]."""


@dataclass(frozen=True)
class Held:
    """How the gauge is held on a motion: at which mounting, and the pose (N,) [rad] where it was attached to the robot.

    ``attached`` is false on the ways to and from that pose. ``ball``: which the motion comes to or leaves, or −1.
    """

    mounting: Mounting
    attached: bool
    mount_deg: tuple[float, ...] = ()
    ball: int = NO_BALL


@dataclass(frozen=True)
class Chain:
    """Points that are driven one after the other under the same constraints.

    Attributes:
        held: how the gauge is held.
        q: the points (n, N) [rad].
        blend: distance from each at which its corner may be cut (n,) [m]; 0 where the robot rests.
        rounded: whether the way may leave a point's corner anywhere on both its legs, (n,) bool: on circles.
        number: of the program's move that leads to the next point, (n − 1,), counted from 1.
        way: number of the start that the chain leads to, or 0.
    """

    held: Held
    q: Array
    blend: Array
    rounded: np.ndarray
    number: np.ndarray
    way: int = 0


@dataclass
class _Walk:
    """Where the robot stands while the instructions are followed, and the points since its constraints changed."""

    here: Angles
    held: Held
    circles: Mapping[PlacedCircle, list[Angles]]
    chains: list[Chain] = field(default_factory=list)
    points: list[tuple[float, ...]] = field(default_factory=list)
    blends: list[float] = field(default_factory=list)
    rounded: list[bool] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)
    paused: bool = True

    def go(self, move: JointMove, number: int, held: Held) -> None:
        """Take one move of the program."""
        if held != self.held or not self.points:
            self.close()
            self.points, self.blends, self.rounded, self.held = [self.here], [0.0], [False], held
        path = (
            [move.q_deg] if move.via_deg is None else self.circles[held.mounting, self.here, move.via_deg, move.q_deg]
        )
        self.points += path
        self.blends += [0.0] * (len(path) - 1) + [move.blend_mm / 1e3]
        self.rounded += [True] * (len(path) - 1) + [False]
        self.numbers += [number] * len(path)
        self.here, self.paused = move.q_deg, False

    def close(self) -> None:
        """End the piece that is open, and begin another."""
        if len(self.points) > 1:
            q, number = read_only(np.deg2rad(self.points)), np.array(self.numbers)
            self.chains.append(Chain(self.held, q, read_only(self.blends), np.array(self.rounded), number))
        self.points, self.blends, self.rounded, self.numbers = [], [], [], []


def recover_motion(cell: Cell, program: Program) -> list[Chain]:
    """Return what is driven from home to the end of the program, and on the way to each of its later starts.

    The first move, to home, is not planned: the operator stands the robot near it, and it is slow.

    Raises:
        NoSolutionError: the program does not begin at the cell's home, the gauge is attached or taken off without a
            pause, or a start leaves out what moves the robot to where it goes on.
    """
    if off := _distance_text(program, tuple(np.rad2deg(cell.home)), program.moves[0].q_deg):
        raise unreleased_error(f"it begins {off} away from the cell's home")
    check_starts(program, cell.has_bar())
    mountings, balls = _next_mountings(program), _balls(program)
    walk = _Walk(program.moves[0].q_deg, Held(FIRST_MOUNTING, False), _circles(cell, program))
    ways: list[Chain] = []
    attached: Mounting | None = None
    mount: tuple[float, ...] = ()
    number = 0
    for item in program.instructions:
        if isinstance(item, Pause):
            walk.paused = True
            if item.led_to_deg is not None:
                _lead(walk, item, number)
        elif isinstance(item, Entry):
            ways.append(_entry_chain(item, mount))
        elif isinstance(item, JointMove):
            number += 1
            if item.mounting != attached:
                if cell.has_bar() and not walk.paused:
                    raise unreleased_error(f"before move {number} the gauge is attached or taken off without a pause")
                attached, mount = item.mounting, walk.here
            if number == 1:
                continue
            here = mountings[number - 1] if attached is None else attached
            ball = max(balls[number - 1], balls[number - 2])
            walk.go(item, number, Held(here, attached is not None, () if attached is None else mount, ball))
    walk.close()
    return walk.chains + ways


def _circles(cell: Cell, program: Program) -> dict[PlacedCircle, list[Angles]]:
    """Return a polygon about the way of the joints on each circle of a program."""
    starts = (program.home_deg, *(m.q_deg for m in program.moves))
    found = [
        (m.mounting or FIRST_MOUNTING, start, m.via_deg, m.q_deg)
        for start, m in zip(starts, program.moves, strict=False)
        if m.via_deg is not None
    ]
    out: dict[PlacedCircle, list[Angles]] = {}
    for mounting in sorted({place for place, *_ in found}):
        here = list(dict.fromkeys(key for key in found if key[0] == mounting))
        try:
            polygons = circle_polygons(cell.at(mounting), [(a, via, b) for _, a, via, b in here])
        except NoSolutionError as err:
            raise unreleased_error(str(err)) from err
        out |= dict(zip(here, polygons, strict=True))
    return out


def _lead(walk: _Walk, item: Pause, number: int) -> None:
    """A person leads the robot from where it waits to where it is measured."""
    assert item.led_to_deg is not None
    walk.go(JointMove(item.led_to_deg, 1.0, 0.0, 100.0), number, walk.held)
    walk.paused = True


def _entry_chain(entry: Entry, mount: tuple[float, ...]) -> Chain:
    """The way to a later start; the gauge is held there as it is on its moves."""
    mounting = entry.moves[0].mounting
    held = Held(mounting or FIRST_MOUNTING, mounting is not None, mount if mounting is not None else ())
    q = np.deg2rad([entry.origin_deg, *(m.q_deg for m in entry.moves)])
    blend = np.array([0.0, *(m.blend_mm / 1e3 for m in entry.moves)])
    return Chain(held, read_only(q), read_only(blend), blend < 0.0, np.arange(1, len(q)), entry.at)


def _next_mountings(program: Program) -> list[Mounting]:
    """How the gauge is held next, for each move; after the last time, how it was held."""
    found = [m.mounting for m in program.moves]
    last = next((m for m in reversed(found) if m is not None), FIRST_MOUNTING)
    out: list[Mounting] = []
    for mounting in reversed(found):
        last = last if mounting is None else mounting
        out.append(last)
    return out[::-1]


def _balls(program: Program) -> list[int]:
    """At which ball each move ends, −1 at none."""
    out: list[int] = []
    for item in program.instructions:
        if isinstance(item, JointMove):
            out.append(NO_BALL)
        elif isinstance(item, Centre):
            out[-1] = item.ball - 1
        elif isinstance(item, Pause) and item.ball is not None:
            out[-1] = item.ball
    return out


@dataclass
class _Piece:
    """A part of a program that is driven or left out as a whole.

    ``until`` of its stretch, or 0; ``at``: the start whose way it is, or 0. From where it was planned and where it
    ends, with the gauge held as told (``before``, ``after``), in words for messages ``what``.
    """

    until: int
    at: int
    first: tuple[float, ...]
    before: Mounting | None
    last: tuple[float, ...] = ()
    after: Mounting | None = None
    rests: bool = True
    paused_first: bool = False
    paused: bool = False
    moved: bool = False

    def add(self, move: JointMove) -> None:
        """Add a segment to the piece."""
        if not self.moved:
            self.paused_first, self.before = self.paused, move.mounting
        self.last, self.after, self.rests = move.q_deg, move.mounting, move.blend_mm == 0.0
        self.moved, self.paused = True, False


def check_starts(program: Program, attached: bool) -> None:
    """Refuse a program in which a later start goes on elsewhere than where the robot then stands.

    Args:
        program: what is driven.
        attached: whether the gauge is held at a fixture too, so that a person takes it off between two ways.

    Raises:
        NoSolutionError: naming the start.
    """
    pieces = [p for p in _pieces(program) if p.moved]
    following = {(id(one), id(other)) for one, other in pairwise(p for p in pieces if not p.at)}
    for start in sorted({number for p in pieces for number in (p.at, p.until) if number}):
        driven = [p for p in pieces if (p.at == start if p.at else p.until == 0 or p.until >= start)]
        for one, other in pairwise(driven):
            gap = _distance_text(program, one.last, other.first)
            held = not attached or one.after == other.before or one.paused or other.paused_first
            rests = one.rests or (id(one), id(other)) in following
            if gap:
                raise unreleased_error(f"started at {start}, it goes on {gap} away from where the robot then stands")
            if not held or not rests:
                how = "does not rest" if held else "holds the gauge otherwise, without a pause"
                raise unreleased_error(f"started at {start}, it goes on where the robot {how}")


def _distance_text(program: Program, one: tuple[float, ...], other: tuple[float, ...]) -> str:
    """Return how far two states are apart, ``5.73 deg``, ``12 mm`` of a joint that slides; empty where they are one.

    Of all joints the one that is farthest off in its own unit's number.
    """
    off = np.abs(np.subtract(one, other))
    farthest = int(off.argmax())
    return f"{off[farthest]:.4g} {program.unit_of(farthest)}" if off[farthest] > np.rad2deg(SAME_ANGLE) else ""


def _pieces(program: Program) -> list[_Piece]:
    """Cut the program where something may be left out."""
    here, held = program.home_deg, None
    out = [_Piece(0, 0, here, held)]
    for item in program.instructions:
        if isinstance(item, StretchBegin | StretchEnd):
            out.append(_Piece(item.until if isinstance(item, StretchBegin) else 0, 0, here, held))
        elif isinstance(item, Entry):
            way = _Piece(0, item.at, item.origin_deg, held)
            for move in item.moves:
                way.add(move)
            out += [way, _Piece(0, 0, here, held)]
        elif isinstance(item, Pause):
            out[-1].paused = True
        elif isinstance(item, JointMove):
            out[-1].add(item)
            here, held = item.q_deg, item.mounting
    return out


def unreleased_error(because: str) -> NoSolutionError:
    """Return the error of a program that must not be driven."""
    return NoSolutionError(f"the program is not released: {because}")
