"""Whether the bodies of an arm hang together at its joints: those of another arm leave gaps that no check would see.

Single bodies that stand somewhere, by themselves: their box, and whether two of them touch.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import InputError
from planner.common.units import Array, to_mm
from planner.kinematics.bodies import Body, rotation_from_z
from planner.kinematics.geometry import pose
from planner.kinematics.robot import Robot
from planner.kinematics.robot_reader import load_in_other_convention
from planner.motion.collision.scene import coal_shape, outline
from planner.motion.planning_packages import coal
from planner.motion.tolerances import BODY_GAP, OTHER_ARM_GAP


@dataclass(frozen=True)
class PlacedShape:
    """The coal geometry of a body, and where it stands in the base frame."""

    shape: coal.CollisionGeometry
    at: coal.Transform3s


def place_shape(body: Body) -> PlacedShape:
    """Return the shape of a body whose pose is that in the base frame."""
    return shape_at(coal_shape(body), body.T)


def shape_at(shape: coal.CollisionGeometry, T: Array) -> PlacedShape:
    """Return a shape at a pose (4, 4) [m] in the base frame."""
    return PlacedShape(shape, coal.Transform3s(np.array(T[:3, :3]), np.array(T[:3, 3])))


def is_touching(a: PlacedShape, b: PlacedShape) -> bool:
    """Tell whether two bodies touch."""
    return bool(coal.collide(a.shape, a.at, b.shape, b.at, coal.CollisionRequest(), coal.CollisionResult()))


def shape_distance(a: PlacedShape, b: PlacedShape) -> float:
    """Return how far two bodies are apart [m]; not above zero where they overlap."""
    return float(coal.distance(a.shape, a.at, b.shape, b.at, coal.DistanceRequest(), coal.DistanceResult()))


def box_about(body: Body) -> tuple[Array, Array]:
    """Return the least and the greatest corner (3,) [m] of a body along the axes of its own frame."""
    points, round_by = outline(body), body.size[0] if body.kind in ("capsule", "sphere") else 0.0
    return points.min(axis=0) - round_by, points.max(axis=0) + round_by


Placed: TypeAlias = "list[tuple[coal.CollisionGeometry, Array]]"


@dataclass(frozen=True)
class BodyGap:
    """Where the bodies of two links do not meet at the joints between them.

    Attributes:
        link: the one nearer to the base; ``after`` the next link that has bodies.
        after: see above.
        joint: number of the joint that ends ``link``.
        apart: distance between the bodies of both links where these joints stand farthest apart [m].
        short: how far the bodies of ``link`` end before the axis of the joint [m]; 0 where it slides. Alone it is no
            gap: the housing of a joint may be the next link's.
        by_hand: whether bodies of ``robot.toml`` are among them; those of a URDF are its maker's.
    """

    link: int
    after: int
    joint: int
    apart: float
    short: float
    by_hand: bool

    def text(self) -> str:
        """Say it for a person."""
        if self.short >= self.apart:
            return (
                f"the bodies of link {self.link} end {to_mm(self.short):.0f} mm before the axis of joint {self.joint}, "
                f"up to {to_mm(self.apart):.0f} mm before those of link {self.after}"
            )
        return (
            f"the bodies of links {self.link} and {self.after} are up to {to_mm(self.apart):.0f} mm apart at joint "
            f"{self.joint}"
        )


def find_body_gaps(robot: Robot) -> tuple[BodyGap, ...]:
    """Return where bodies of links that follow each other are farther than ``BODY_GAP`` from meeting at their joints.

    Links without bodies are passed over, and so is what hangs beside the chain of a URDF.
    """
    shapes: dict[int, Placed] = {}
    for link, body in robot.bodies:
        if not body.branch:
            shapes.setdefault(link, []).append((coal_shape(body), body.T))
    by_hand = {link for link, body in robot.bodies if not body.part}
    gaps = []
    for link, after in pairwise(sorted(shapes)):
        states = _states_between(robot, link, after)
        apart = _widest_gap(robot, shapes, (link, after), states)
        short = _shortfall(robot, shapes[link], link)
        gaps.append(BodyGap(link, after, link + 1, apart, short, bool({link, after} & by_hand)))
    return tuple(gap for gap in gaps if gap.apart > BODY_GAP)


def refuse_foreign_bodies(cell: Cell) -> None:
    """Refuse bodies of ``robot.toml`` that end far before the next joint: the proofs would be of another arm.

    Raises:
        InputError: naming the links, how far their bodies are from meeting, and what helps.
    """
    robot = cell.robot
    gaps = [g for g in find_body_gaps(robot) if g.by_hand and g.after == g.joint and g.apart > OTHER_ARM_GAP]
    if not gaps:
        return
    raise InputError(
        f"{robot.path}: {'; '.join(g.text() for g in gaps)}: these [[bodies]] are another arm's, or the rows "
        f"(convention '{robot.convention}', a_mm, d_mm, alpha_deg) are wrong: a path would be proven for an arm with "
        f"holes. {_cure(robot)}"
    )


def clearance_text(cell: Cell, clearance: float) -> str:
    """Say how near bodies come [m], and of what that is proven: of bar and tool alone where the arm has no bodies."""
    mm = f"{to_mm(clearance):.1f} mm"
    if not cell.robot.bodies:
        return f"only {_carried_text(cell)} checked, {mm} from the rest: {cell.robot.name} has no bodies"
    holes = ", of an arm with gaps (see the note)" if find_body_gaps(cell.robot) else ""
    return f"nearest bodies {mm} apart, proven by two engines{holes}"


def describe_body_gaps(cell: Cell) -> tuple[str, ...]:
    """Say where the arm has gaps, or no body at all, so that no check of collisions sees it; else nothing."""
    robot = cell.robot
    if not robot.bodies:
        where = f"[[bodies]] of {robot.path.name} add" if robot.path.suffix == ".toml" else "a robot.toml can add"
        checked = f"only {_carried_text(cell)} checked against the surroundings, and the arm itself may meet anything"
        return (f"{robot.name} has no collision bodies: {checked}; {where} them (docs/tutorials/kuka-bar.md)",)
    gaps = find_body_gaps(robot)
    if not gaps:
        return ()
    return (
        f"the arm's shape has gaps, where collisions are not seen: {'; '.join(g.text() for g in gaps)}; look at it in "
        f"report.html, and add what is missing ([[bodies]] of {robot.path.name})",
    )


def _carried_text(cell: Cell) -> str:
    return f"the {cell.gauge.noun} and the tool were" if cell.has_bar() else "the tool was"


def _cure(robot: Robot) -> str:
    """Say how the bodies become those of this arm; where they meet in the other convention, that it may be meant."""
    other = load_in_other_convention(robot)
    if other is not None and not find_body_gaps(other):
        return f'with convention = "{other.convention}" all bodies meet at their joints: are the rows of that one?'
    return (
        "give each link bodies that reach from its joint to the next, as the data sheet's drawing has it: from_mm and "
        f"to_mm in the frame of link. Or take all [[bodies]] out of {robot.path.name}: then bar and tool alone are "
        "checked, and it is said"
    )


def _states_between(robot: Robot, link: int, after: int) -> Array:
    """Return states (n, N) [rad] that try the joints between two links; the others stand in the middle of theirs."""
    tried = 16  # states: at a joint the bodies are round enough that a sixteenth of its range shows where they part
    lower, upper = (np.nan_to_num(end, posinf=np.pi, neginf=-np.pi) for end in robot.one_turn)
    q = np.tile((lower + upper) / 2, (tried, 1))
    shares = (np.arange(tried) + 0.5) / tried
    between = range(link, min(after, robot.n_joints))
    for k, joint in enumerate(between):
        # one joint evenly; several as a lattice, each with another order of the same shares
        share = shares if k == 0 else shares[(np.arange(tried) * (2 * k + 3)) % tried]
        q[:, joint] = lower[joint] + (upper[joint] - lower[joint]) * share
    return q


def _widest_gap(robot: Robot, shapes: dict[int, Placed], links: tuple[int, int], q: Array) -> float:
    """Return the largest distance between the bodies of two links over states (n, N) [m]; 0 where they always touch."""
    frames = [_link_frames(robot, link, q) for link in links]
    widest = 0.0
    for one, other in zip(*frames, strict=True):
        near, far = _place(shapes[links[0]], one), _place(shapes[links[1]], other)
        widest = max(widest, min(shape_distance(a, b) for a in near for b in far))
    return widest


def _shortfall(robot: Robot, shapes: Placed, link: int) -> float:
    """Return how far the bodies of a link are from the axis of the next joint [m]; 0 of a joint that slides."""
    if link >= robot.n_joints or robot.slides[link]:
        return 0.0
    q = np.zeros((1, robot.n_joints))
    stand, k = robot.chain.forward(robot.theta(q)), robot.chain.joint_places[link]
    along = rotation_from_z(stand.u[k][:, 0])
    axis = coal.Capsule(1e-9, 2 * sum(t.extent for t in robot.transforms if t.kind == "translation") + 1.0)
    line = shape_at(axis, pose(along, stand.p[k][:, 0]))
    return max(0.0, min(shape_distance(a, line) for a in _place(shapes, _link_frames(robot, link, q)[0])))


def _link_frames(robot: Robot, link: int, q: Array) -> list[Array]:
    """Return the frame of a link at each state (n, N), n poses (4, 4) [m]."""
    ((R, p),) = robot.chain.frames(robot.theta(q), [robot.link_end[link]])
    R, p = np.broadcast_to(R, (3, 3, len(q))), np.broadcast_to(p, (3, len(q)))
    return [pose(R[:, :, i], p[:, i]) for i in range(len(q))]


def _place(shapes: Placed, frame: Array) -> list[PlacedShape]:
    return [shape_at(shape, frame @ T) for shape, T in shapes]
