"""A small plan made of real parts: only the path is not planned, it goes straight from pose to pose."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from planner.cell.cell import Cell
from planner.cell.reading import load_cell
from planner.design.candidates.pool import draw_candidates
from planner.design.off_grid import certify_off_grid
from planner.design.pose_selection import PoseChoice, identify_candidates
from planner.design.selection.index_search import compute_index_curve, exchange_poses
from planner.kinematics.geometry import bar_state
from planner.motion.path.verdict import PathLeg, ProvenPath, Verdict
from planner.motion.timing.leg_times import axis_limits
from planner.motion.timing.trajectory import check_limits
from planner.motion.tour.solve import solve_tour
from planner.runs.run import FIRST_MOUNTING, Mounting
from planner.session.plan_types import Drive, Plan, Visit, Waypoints, motion_signs, time_course
from planner.session.tour_cost import tour_costs
from tests.not_everywhere import require_planning

PLAN_ID = "0123456789ab"
FIXTURE = "A</script>"  # a name that would end a script, were it not escaped
MOVED = 1e-4  # [rad] off the grid of candidates
NOTE = "a pose that no path could join was replaced <fixture A>"


def made_plan(poses: int = 28, candidates: int = 600) -> Plan:
    require_planning()
    cell = load_cell("comau-nj130/edbb")
    cell = replace(cell, fixtures=(replace(cell.fixtures[0], name=FIXTURE),))
    pool = draw_candidates(cell, candidates)
    model, seen, rows = identify_candidates(cell, pool)
    curve = compute_index_curve(rows, (26, poses, 40, 80), "O2", steps=20)
    found = exchange_poses(rows, poses, "O2", starts=1, certificate=curve.selections[1].certificate, steps=20)
    choice = PoseChoice.of_candidates(pool, found.chosen, model, seen, found.certificate)
    choice = replace(choice, q=choice.q + MOVED)
    drive = made_drive(cell, FIRST_MOUNTING, np.vstack([pool.q[:1], choice.candidates.q, pool.q[1:4]]), poses)
    return Plan(
        cell=cell,
        seed=0,
        drives=(drive,),
        notes=(NOTE,),
        plan_id=PLAN_ID,
        pool=pool,
        choice=choice,
        certificate=certify_off_grid(cell, pool, choice),
        curve=curve,
        driven=1.03 * found.value,
    )


def made_drive(cell: Cell, mounting: Mounting, nodes: np.ndarray, poses: int) -> Drive:
    """Drive the nodes, the mount pose first, straight in the order of the tour; the last node comes twice."""
    tour = solve_tour(tour_costs(cell, mounting, nodes))
    order = np.array([*tour.order, tour.order[1], 0])
    q = nodes[order]
    length = bar_state(cell.map_position(q), cell.fixtures[mounting.fixture].p_BX).length
    roles = np.array(["mount", *["calibrate"] * poses, *["validate"] * (len(nodes) - poses - 1)])[order]
    roles[-2] = "repeat"
    approach = motion_signs(q)
    visits = tuple(
        Visit(
            k, q[k], float(length[k]), mounting, str(roles[k]), tuple(approach[k]), 1 if roles[k] == "repeat" else None
        )
        for k in range(len(order))
    )
    legs = tuple(PathLeg(a, b, np.empty((0, 6))) for a, b in pairwise(order))
    verdict = Verdict("coal", 0.0123, float(length.min()), float(length.max()), ())
    path = ProvenPath(q, order, legs, verdict, replace(verdict, engine="python-fcl"))
    blend = np.where((np.arange(len(q)) == 0) | (np.arange(len(q)) == len(q) - 1), 0.0, cell.motion.blend)
    travel = Waypoints(np.vstack([cell.home, nodes[0]]), np.array([-1, 0]), np.zeros(2))
    timed = time_course(cell, mounting, travel, Waypoints(q, np.arange(len(q)), blend))
    limits = check_limits(timed.trajectory, axis_limits(cell, bar=True), dt_s=0.5)
    verdicts = (path.verdict, path.second, path.verdict, path.second)
    return Drive(course=timed, verdicts=verdicts, visits=visits, tour=tour, path=path, limits=limits)
