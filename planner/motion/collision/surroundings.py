"""Whether the surroundings of a cell can be meant as they are written: sizes, units, reach, the floor."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from planner.cell.cell import Cell
from planner.cell.places import joint_keys
from planner.common.errors import InputError
from planner.common.summary import Aside
from planner.common.units import Array, to_mm
from planner.kinematics.bodies import Body
from planner.kinematics.robot import Robot
from planner.kinematics.robot_reader import load_in_other_convention
from planner.motion.collision.body_gaps import place_shape, refuse_foreign_bodies, shape_at, shape_distance
from planner.motion.collision.engines import CollisionWorld
from planner.motion.collision.scene import FLOOR, SceneBody, advise_never_meet, build_scene, mesh_faces, polytope_excess
from planner.motion.planning_packages import coal
from planner.motion.tolerances import CARRIED_REACHES, HALL, LEAST_SIZE

SHOWN_PAIRS = 12  # of bodies that a message names


def check_surroundings(cell: Cell) -> None:
    """Refuse meshes of a size that no such body has, bodies of another arm, obstacles that nothing can reach, and a
    floor above the arm.

    Raises:
        InputError: naming the body, what was found, and which unit would make sense of it.
    """
    for m in cell.mountings:
        pieces = build_scene(cell, m).pieces
        reach = max((_reach(cell.at(m), m.fixture, p) for p in pieces if p.carrier != "world"), default=0.0)
        for piece in pieces:
            _check_mesh(cell, piece)
        for body in cell.obstacles:
            _check_obstacle_distance(cell, body, reach)
    refuse_foreign_bodies(cell)
    _check_floor(cell)
    _check_apart(cell)


def unchecked_links_text(cell: Cell) -> tuple[str, ...]:
    """Say which links of the robot are not checked against each other: neighbours, and those that its file names."""
    robot = cell.robot
    links = sorted({link for link, b in robot.bodies if not b.branch})
    if not links:
        return ()
    neighbours = [f"{a} and {b}" for a, b in pairwise(links) if b - a == 1]
    named = ", ".join(f"{a} and {b}" for a, b in sorted(robot.never_meet))
    said = (", ".join(neighbours), named and f"{named} ({robot.never_meet_reason})", *_unchecked_links_by_name(cell))
    told = "; ".join(filter(None, said))
    return (Aside(f"bodies of these links are not checked against each other: {told}"),) if told else ()


def _unchecked_links_by_name(cell: Cell) -> list[str]:
    """Say which links, by name, would be checked against each other if no file said that they may touch."""
    robot = cell.robot
    there = {b.part: (link, b.rigid) for link, b in robot.bodies}
    reasons: dict[str, list[str]] = {}
    for one, other, why in robot.never_meet_parts:
        if one in there and other in there:
            (a, rigid), (b, other_rigid) = there[one], there[other]
            if a != b and frozenset((rigid, other_rigid)) not in robot.neighbours:
                reasons.setdefault(why, []).append(f"{one} and {other}")
    return [
        ", ".join(pairs[:SHOWN_PAIRS])
        + (f" and {len(pairs) - SHOWN_PAIRS} more pairs" if len(pairs) > SHOWN_PAIRS else "")
        + f" ({why})"
        for why, pairs in reasons.items()
    ]


def describe_parked_joints(cell: Cell) -> tuple[str, ...]:
    """Return the sentence that names all joints that must stand still, and where; none if every joint is driven."""
    if not cell.robot.parked:
        return ()
    together: dict[str, list[str]] = {}
    for j in cell.robot.parked:
        together.setdefault(f"at {j.text}{f' ({j.why})' if j.why else ''}", []).append(j.name)
    stands = "; ".join(f"{', '.join(names)} {place}" for place, names in together.items())
    return (
        f"these joints stand still and must be there before the program starts: {stands}; another place is said in "
        "[parked] of cell.toml or robot.toml",
    )


def describe_polytopes(cell: Cell) -> tuple[str, ...]:
    """Say which meshes stand as convex polytopes in every check, and how far these stand beyond the meshes' hulls."""
    shapes = {b.mesh: b for _, b in cell.robot.bodies if b.kind == "mesh" and b.hull}
    shapes |= {b.mesh: b for b in (*cell.tool.bodies, *cell.obstacles) if b.kind == "mesh" and b.hull}
    if not shapes:
        return ()
    excess = to_mm(max(polytope_excess(b) for b in shapes.values()))
    return (
        Aside(
            f"{len(shapes)} meshes are checked for collisions as the convex polytopes around them, which hold the "
            f"meshes and stand at most {excess:.1f} mm beyond their convex hulls. Where a mesh is hollow, nothing may "
            "enter"
        ),
    )


def describe_unchecked_links(cell: Cell) -> tuple[str, ...]:
    """Return a sentence with every link of the robot's URDF that no proof of this program knows; none if all are."""
    reasons: dict[str, list[str]] = {}
    for name, reason in cell.robot.unchecked_links:
        reasons.setdefault(reason, []).append(name)
    if not reasons:
        return ()
    links = "; ".join(f"{', '.join(names)} ({reason})" for reason, names in reasons.items())
    return (
        f"not checked for collisions are these links of the robot: {links}; keep them clear by hand, or give their "
        "shapes in tool.bodies, in obstacles or as collision shapes of the URDF",
    )


def _check_apart(cell: Cell) -> None:
    """Refuse bodies that touch wherever the robot stands: everything would collide, and nothing may be left out."""
    scene = build_scene(cell).without_bar()
    world = CollisionWorld(scene)
    found = world.always_touching()
    if not found:
        return
    pieces = [tuple(scene.pieces[i] for i in scene.pairs[k]) for k in found]
    keys = sorted({key for key in map(scene.never_meet_key, found) if key})
    hint = "mend their shapes or places"
    if any(FLOOR in (a.body.name, b.body.name) for a, b in pieces):
        hint += ", or set base.floor_mm to where the floor is"
    if keys:
        hint += f", or, where only crude shapes touch, {advise_never_meet(keys)}"
    distance = world.distances(cell.home[None])[0]
    names = "; ".join(
        f"{scene.describe_pair(k)}, {to_mm(abs(distance[k])):.1f} mm "
        f"{'apart' if distance[k] > 0 else 'into each other'} at home"
        for k in found[:SHOWN_PAIRS]
    )
    raise InputError(
        f"{cell.path}: these bodies come closer than motion.clearance_mm = {to_mm(cell.motion.clearance):g} wherever "
        f"the robot stands: {names}; {hint}"
    )


def _reach(cell: Cell, fixture: int, piece: SceneBody) -> float:
    """Farthest from the base's origin that any point of a moving body can be [m]."""
    robot = cell.robot
    if piece.carrier == "housing":
        return float(np.linalg.norm(cell.fixtures[fixture].p_BX)) + piece.reach
    end = len(robot.transforms) if piece.carrier == "rod" else robot.link_end[piece.link]
    moves = sum(t.extent for t in robot.transforms[:end] if t.kind == "translation")
    tool = float(np.linalg.norm(cell.tool.p_FM)) if piece.carrier == "rod" else 0.0
    return float(moves) + tool + piece.reach


def _check_mesh(cell: Cell, piece: SceneBody) -> None:
    if piece.body.kind != "mesh":
        return
    vertices = mesh_faces(piece.body)[0]
    size = float(np.ptp(vertices, axis=0).max())
    carried = sum(t.extent for t in cell.robot.transforms if t.kind == "translation")
    largest = CARRIED_REACHES * max(float(carried), 0.1) if piece.carrier == "link" else HALL
    if not LEAST_SIZE <= size <= largest:
        raise InputError(
            f"{cell.path}: the mesh {piece.body.mesh} of '{piece.body.name}' is {to_mm(size):.4g} mm long with its "
            f"scale: {_unit_hint(piece.body)}"
        )


def _check_obstacle_distance(cell: Cell, body: Body, reach: float) -> None:
    """Refuse an obstacle outside of the ball about the base that holds all that moves."""
    distance = shape_distance(shape_at(coal.Sphere(1e-6), np.eye(4)), place_shape(body))
    if distance > reach + cell.motion.clearance:
        hint = f"; {_unit_hint(body)}" if body.kind == "mesh" else ""
        raise InputError(
            f"{cell.path}: nothing can reach the obstacle '{body.name}': it is {to_mm(distance):.5g} mm from the base, "
            f"and arm, tool and gauge end {to_mm(reach):.5g} mm from it; correct its place, or leave it out{hint}"
        )


def _unit_hint(body: Body) -> str:
    return f'its numbers are taken times {body.scale[0]:g} m; say unit = "mm" or unit = "m" (or the scale of a URDF)'


def _check_floor(cell: Cell) -> None:
    """Refuse a floor that stands above the base, as gravity goes, and a home that reaches below the floor."""
    up = float(cell.base.R_WB[2, 2])
    if cell.base.floor is None or abs(up) < 0.5:
        return
    robot = cell.robot
    heights = _heights_of_frames(robot, cell.home) * np.sign(up)
    lowest = int(np.argmin(heights))
    if heights[lowest] >= np.sign(up) * cell.base.floor:
        return
    floor, height = to_mm(cell.base.floor), to_mm(np.sign(up) * heights[lowest])
    if lowest > 1:  # the frames of the base and of link 1 stand at one height, whatever home is
        raise InputError(
            f"{cell.path}: {joint_keys(robot, 'home')} cannot be the start pose: the frame of link {lowest} is at "
            f"{height:.1f} mm there, beyond the {FLOOR} (base.floor_mm = {floor:g}){_row_doubt(cell, up)}"
        )
    raise InputError(
        f"{cell.path}: the {FLOOR} (base.floor_mm = {floor:g}) stands above link {lowest}, whose "
        f"frame at home is at {height:.1f} mm"
    )


def _heights_of_frames(robot: Robot, q: Array) -> Array:
    """Return how high the frames of links 0 to N stand at q (N,) [rad] along z of the base, (N + 1,) [m]."""
    frames = robot.chain.frames(robot.theta(q[None]), robot.link_end[1:])
    return np.array([0.0, *(origin[2, 0] for _, origin in frames)])


def _row_doubt(cell: Cell, up: float) -> str:
    """Say what of the rows may be wrong where home lies beyond the floor; nothing of a URDF."""
    robot, floor = cell.robot, cell.base.floor
    if robot.convention == "urdf" or floor is None:
        return ""
    keys = joint_keys(robot, "home")
    asked = f"; is {keys} that of this robot, are its rows in degrees, and of convention '{robot.convention}'?"
    other = load_in_other_convention(robot)
    if other is not None and (_heights_of_frames(other, cell.home) * np.sign(up)).min() >= np.sign(up) * floor:
        return f'{asked} With convention = "{other.convention}" all of it would stand on the right side of the {FLOOR}'
    return asked
