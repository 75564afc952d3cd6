"""The path of the arm round one circle: timed, within limits, proven free of collision."""

from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell
from planner.cell.circles import Circle
from planner.common.errors import NoSolutionError
from planner.common.units import Array, round_angles, to_deg
from planner.instruments.circular.configurations import (
    COARSE_STEP,
    ArmPaths,
    check_bar,
    find_arm_paths,
    fine_angles,
    orientations,
)
from planner.instruments.circular.plan import Arc, drive_arc
from planner.kinematics.inverse_kinematics import solve_pose_ik
from planner.motion.path.constraints import Constraints
from planner.session.release import judge_corners

MOST_TRIALS = 6  # ways that are driven finely and judged before the circle is given up
ROOMY_SHARE = 0.6  # share of the largest room that a way must have, to be taken because it begins nearer
IK_ROUNDS = 12  # of Newton from the coarse places to the points between


def plan_arc(cell: Cell, circle: Circle, seed: int = 0, near: Array | None = None) -> Arc:
    """Plan the way round a circle: of the roomy ones the nearest.

    Args:
        cell: where a fixture has a mount pose, the twist of a cable along the bar counts from there; else from the
            beginning of the circle, which becomes the mount pose.
        circle: one of the cell's.
        seed: of everything random.
        near: the state from which the arm comes (N,) [rad], home if ``None``.

    Raises:
        InputError: the bar does not reach round.
        NoSolutionError: the arm does not; or it collides.
    """
    check_bar(cell, circle)
    ways = find_arm_paths(cell, circle, seed)
    constraints = Constraints(cell, circle.mounting)
    n = cell.robot.n_joints
    hits = constraints.world.near(ways.q.reshape(-1, n), constraints.clearance).reshape(ways.q.shape[:2])
    free = np.flatnonzero(~hits.any(axis=1))
    if not len(free):
        raise NoSolutionError(_explain_collision(constraints, circle, ways, hits))
    why = ""
    for k in _order_paths(cell, ways, free, cell.home if near is None else near)[:MOST_TRIALS]:
        arc, why = _finish_arc(cell, circle, ways, k, len(free), constraints)
        if arc is not None:
            return arc
    raise NoSolutionError(
        f"circle {circle.name}: {len(free)} ways round are free at places {to_deg(COARSE_STEP):.0f}° apart, but none of"
        f" the first {MOST_TRIALS} is proven in between ({why}): lower motion.clearance_mm, or move the circle"
    )


def _order_paths(cell: Cell, ways: ArmPaths, free: np.ndarray, near: Array) -> list[int]:
    """Roomy ways by the time that it takes to come to their beginning, then the others by their room."""
    away = (np.abs(ways.q[free, 0] - near) / cell.robot.speed).max(axis=1)
    roomy = ways.room[free] >= ROOMY_SHARE * ways.room[free[0]]
    return [int(k) for k in free[np.lexsort((np.round(np.where(roomy, away, -ways.room[free]), 6), ~roomy))]]


def _finish_arc(
    cell: Cell, circle: Circle, ways: ArmPaths, k: int, free: int, constraints: Constraints
) -> tuple[Arc | None, str]:
    """Drive one way finely; returned is it, or a sentence that says what is wrong with it."""
    angle = fine_angles(circle)
    guess = np.column_stack([np.interp(angle, ways.angle, column) for column in ways.q[k].T])
    wanted = circle.points(angle), orientations(circle, angle, ways.R_BF[k])
    q, good = solve_pose_ik(cell.chain, cell.robot, guess, *wanted, IK_ROUNDS)
    if not good.all():
        return None, f"the arm loses its configuration at {to_deg(angle[np.argmin(good)]):.0f}°"
    q = round_angles(q)
    if cell.mount(circle.mounting) is None:
        constraints = _with_mount(constraints, q[0] if circle.directions[0] == "ccw" else q[-1])
    arc = drive_arc(cell, circle, angle, q, cell.motion.blend or cell.motion.clearance)
    verdicts, _ = judge_corners(constraints, q, arc.ccw.trajectory)
    bad = [f for v in verdicts for f in v.failures]
    if bad:
        return None, bad[0]
    return replace(arc, verdicts=verdicts, told=f"{ways.told}, {free} of these without collision"), ""


def _with_mount(constraints: Constraints, mount: Array) -> Constraints:
    """Count the cable's twist along the bar from a mount pose."""
    held = constraints.workspace.mounting
    cell = constraints.cell.with_mount(held, mount)
    return Constraints(cell, held, constraints.bar, constraints.scene, constraints.room)


def _explain_collision(constraints: Constraints, circle: Circle, ways: ArmPaths, hits: np.ndarray) -> str:
    """Say where the way that collides least does so, and with what."""
    best = int(np.argmin(hits.sum(axis=1)))
    k = int(np.argmax(hits[best]))
    why = constraints.reason(ways.q[best, k]) or "a collision"
    return (
        f"circle {circle.name}: {ways.told}, but each collides somewhere; the one that does least often first at "
        f"{to_deg(ways.angle[k]):.0f}°: {why}; move the circle or the fixture, change radius_mm, give tool_axis, "
        "or lower motion.clearance_mm"
    )
