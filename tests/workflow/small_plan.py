"""A small plan whose drive is proven: a few poses that straight joint motions join, from home and back."""

import json
from functools import cache
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.cell.reading import load_cell
from planner.common.units import Array, round_angles
from planner.design.candidates.pool import draw_candidates
from planner.motion.path.constraints import Constraints
from planner.runs.run import FIRST_MOUNTING
from planner.session.plan_record import content_hash, part_hashes, waypoint_records
from planner.session.plan_types import Course, Waypoints, time_course
from planner.session.planned_session import NOT_HASHED
from planner.workflow.plan_results import write_cell
from tests.not_everywhere import require_planning

CANDIDATES = 400
APART = 0.3  # [rad] between any two poses, by the joint that turns furthest


@cache
def proven_tour(name: str, count: int) -> Array:
    """Return a mount pose, ``count`` others and the mount pose again (count + 2, N) [rad], joined by proven legs."""
    cell = load_cell(name)
    pool = round_angles(draw_candidates(cell, CANDIDATES, 0).q)
    without = Constraints(cell, bar=False)
    reached = without.prove(np.broadcast_to(cell.home, pool.shape), pool).proven
    for mount in pool[reached]:
        held = Constraints(cell.with_mount(FIRST_MOUNTING, mount))
        tour = [mount]
        for q in pool:
            apart = min(np.abs(q - other).max() for other in tour) > APART
            if len(tour) <= count and apart and all(held.prove(a[None], q[None]).proven[0] for a in (tour[-1], mount)):
                tour.append(q)
        if len(tour) == count + 1:
            return np.array([*tour, mount])
    raise AssertionError("no proven tour")


def small_course(cell: Cell, tour: Array) -> Course:
    """Return the course through a tour, at rest at every pose."""
    travel = round_angles(np.array([cell.home, tour[0]]))
    ids = np.array([*range(len(tour))])
    return time_course(
        cell,
        FIRST_MOUNTING,
        Waypoints(travel, np.array([-1, 0]), np.zeros(2)),
        Waypoints(tour, ids, np.zeros(len(tour))),
    )


STATISTICS = {
    "seed": 3,
    "funnel": {"sampled": 4000, "joint_limits": 3900, "collision": 1200},
    "observability": {"index": "O1", "n": 3, "O1": 2.5, "O2": 71.3, "scaled": {"O1": 0.8}, "gap": 0.012, "bound": 2.53},
    "tour": {"unsorted_s": 50.5, "cost_s": 30.25, "lower_bound_s": 30.25, "optimal": True},
    "path": {"legs": 3, "direct_legs": 3, "clearance_mm": 11.37, "length_min_mm": 311.2, "length_max_mm": 498.4},
}
"""What a plan states of itself beside what is driven."""


def write_small_plan(folder: Path, name: str, count: int) -> dict[str, object]:
    """Write the plan of a proven tour with its cell, signed and with hashes; return what ``plan.json`` says."""
    require_planning()
    cell, tour = load_cell(name), proven_tour(name, count)
    course = small_course(cell, tour)
    length = np.linalg.norm(cell.map_position(tour) - cell.fixtures[0].p_BX, axis=1) * 1e3
    pose = {"fixture": "A", "role": "calibrate"}
    rows = [{"q_deg": np.rad2deg(q).tolist(), "length_mm": float(x)} for q, x in zip(tour, length, strict=True)]
    drive = {"fixture": "A", "travel": waypoint_records(course.travel), "waypoints": waypoint_records(course.measuring)}
    content = {
        "robot": cell.robot.name,
        **STATISTICS,
        "poses": [{"id": k, **row, **pose} for k, row in enumerate(rows)],
        "trajectory": {"duration_s": course.trajectory.duration_s, "measuring_s": course.trajectory.measuring_s},
        "drives": [drive],
    }
    plan = json.loads(json.dumps({"schema": "edbb-plan/1", "plan_id": "0" * 12, **content}, default=np.ndarray.tolist))
    write_cell(cell, folder)
    plan["plan_id"] = content_hash({k: v for k, v in plan.items() if k not in NOT_HASHED}, cell)
    plan["hashes"] = part_hashes(plan, cell)
    (folder / "plan.json").write_text(json.dumps(plan))
    return plan
