"""The cell with its fixture somewhere else: what moves with it, whether it can stand there, and what it can reach."""

from dataclasses import dataclass, replace
from typing import Literal

import coal
import numpy as np

from planner.cell.cell import Cell
from planner.cell.workspace import STAGES, Workspace
from planner.common.units import Array, read_only
from planner.kinematics.bodies import Body
from planner.motion.collision.engines import CollisionWorld
from planner.motion.collision.pieces import coal_shape
from planner.motion.collision.scene import build_scene

ROUNDS = (1 << 13, 1 << 13, 1 << 14, 1 << 15)  # joint samples tried at one place, until there are enough candidates
NEAR = 0.25  # [m] a body that ends no further below the fixture than this holds it up
UPRIGHT = 0.999  # cosine above which a body counts as standing straight

Status = Literal["usable", "blocked", "unreachable", "cones", "cable", "colliding", "few", "blind"]


@dataclass(frozen=True)
class FixtureReach:
    """What the gauge reaches from one place: poses q (n, N) [rad], and the stage that emptied them if n is 0."""

    q: Array
    status: Status


def find_stands(cell: Cell, fixture: int = 0) -> tuple[int, ...]:
    """Positions in ``cell.obstacles`` of the bodies that hold the fixture up.

    These are the bodies right under it: their footprint holds the fixture's plumb line, and they end
    below it by no more than a quarter of a metre. They belong to the fixture and go where it goes.
    """
    place = cell.fixtures[fixture].p_BX
    return tuple(k for k, body in enumerate(cell.obstacles) if _is_stand(body, place))


def _is_stand(body: Body, place: Array) -> bool:
    if body.kind == "mesh":
        return False
    box = coal_shape(body)
    box.computeLocalAABB()
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    low, high = np.array(box.aabb_local.min_), np.array(box.aabb_local.max_)
    points = (low + corners * (high - low)) @ body.T[:3, :3].T + body.T[:3, 3]
    least, most = points.min(axis=0), points.max(axis=0)
    under = bool(np.all(least[:2] <= place[:2]) and np.all(place[:2] <= most[:2]))
    return under and most[2] <= place[2] + 1e-9 and place[2] - most[2] <= NEAR


def move_fixture(cell: Cell, place: Array, fixture: int = 0) -> Cell:
    """Return the cell with one fixture at ``place`` (3,) [m], and no other; its stand comes along, its foot stays down.

    An upright capsule or box under the fixture grows or shrinks by the change of height; any other body that
    holds the fixture is carried along as it is. All other obstacles stay where they are.
    """
    old = cell.fixtures[fixture]
    step = np.asarray(place) - old.p_BX
    mine = find_stands(cell, fixture)
    bodies = tuple(_move_stand(b, step) if k in mine else b for k, b in enumerate(cell.obstacles))
    return replace(cell, fixtures=(replace(old, p_BX=read_only(place)),), obstacles=bodies)


def _move_stand(body: Body, step: Array) -> Body:
    T, size = np.array(body.T), list(body.size)
    upright = body.kind in ("capsule", "box") and abs(T[2, 2]) > UPRIGHT
    T[:3, 3] += step
    if upright:
        grown = max(size[-1] + step[2], 0.0 if body.kind == "capsule" else 1e-3)
        T[2, 3] -= (grown - size[-1]) / 2  # the top follows the fixture, the foot stays
        size[-1] = grown
    return replace(body, T=read_only(T), size=tuple(size))


def is_blocked(cell: Cell, present: Cell) -> bool:
    """Tell whether fixture or stand stand where something else stands already.

    What the stand touches in the ``present`` cell (the same obstacles in the same order) is what it stands on.
    """
    mine = find_stands(present)
    place = cell.fixtures[0].p_BX
    if cell.base.floor is not None and place[2] < cell.base.floor:
        return True
    now, then = [[_fixture_sphere(c), *(_body_shape(c.obstacles[k]) for k in mine)] for c in (cell, present)]
    fixed = [_body_shape(b) for link, b in cell.robot.bodies if link == 0]
    fixed += [_body_shape(b) for k, b in enumerate(cell.obstacles) if k not in mine]
    return any(_is_touching(a, b) and not _is_touching(was, b) for a, was in zip(now, then, strict=True) for b in fixed)


def _fixture_sphere(cell: Cell) -> tuple[coal.CollisionGeometry, coal.Transform3s]:
    return coal.Sphere(cell.gauge.radius), coal.Transform3s(np.eye(3), np.array(cell.fixtures[0].p_BX))


def _body_shape(body: Body) -> tuple[coal.CollisionGeometry, coal.Transform3s]:
    return coal_shape(body), coal.Transform3s(np.array(body.T[:3, :3]), np.array(body.T[:3, 3]))


def _is_touching(
    a: tuple[coal.CollisionGeometry, coal.Transform3s], b: tuple[coal.CollisionGeometry, coal.Transform3s]
) -> bool:
    return bool(coal.collide(*a, *b, coal.CollisionRequest(), coal.CollisionResult()))


def reach_poses(cell: Cell, place: Array, wanted: int, seed: int) -> FixtureReach:
    """Draw up to ``wanted`` poses with the first fixture alone, at ``place`` (3,) [m], all filters kept.

    A bounded number of joint samples is tried: a place that the arm hardly reaches is told as such, soon.
    """
    present, cell = cell, move_fixture(cell, place)
    if is_blocked(cell, present):
        return FixtureReach(np.empty((0, cell.robot.n_joints)), "blocked")
    workspace, world = Workspace(cell), CollisionWorld.from_cell(cell)
    if _is_stand_in_robot(cell, find_stands(present), world):
        return FixtureReach(np.empty((0, cell.robot.n_joints)), "blocked")
    draw, found, left = cell.gauge.joint_sampler(cell, 0, seed), [], np.zeros(len(STAGES) + 1, int)
    for samples in ROUNDS:
        q = draw(samples).q
        for k, stage in enumerate(STAGES):
            q = q[(workspace.stage(stage, q) > 0).all(axis=1)]
            left[k] += len(q)
        q = q[~world.collides(q)] if len(q) else q
        left[-1] += len(q)
        found.append(q)
        if left[-1] >= wanted:
            break
    q = np.vstack(found)[:wanted]
    emptied: tuple[Status, ...] = ("unreachable", "unreachable", "cones", "cable", "colliding")
    return FixtureReach(read_only(q), "usable" if len(q) else emptied[int(np.flatnonzero(left == 0)[0])])


def _is_stand_in_robot(cell: Cell, mine: tuple[int, ...], world: CollisionWorld) -> bool:
    """Tell whether the stand touches a link at every state: the collision check leaves such pairs out."""
    own, scene = [cell.obstacles[k] for k in mine], build_scene(cell)
    lost = set(scene.pairs) - set(world.scene.pairs)
    return any(scene.pieces[k].body is body for pair in lost for k in pair for body in own)
