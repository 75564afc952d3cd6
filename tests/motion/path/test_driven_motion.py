"""The motion that a program drives lies in the regions that are proven for it; what does not join is not released."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from planner.cell.reading import load_cell
from planner.common.errors import InputError, NoSolutionError
from planner.common.units import round_angles
from planner.kinematics.inverse_kinematics import solve_pose_ik
from planner.motion.path.constraints import Constraints
from planner.motion.path.proof import Neighbourhoods
from planner.motion.tolerances import MOST_BISECTIONS
from planner.programs.dialect import PathForm, load_dialect
from planner.programs.instructions import Entry, JointMove, Pause, StretchBegin
from planner.runs.run import FIRST_MOUNTING
from planner.session.driven_motion import Chain, Held, circle_polygons, recover_motion
from planner.session.driven_moves import dense_moves
from planner.session.judgement import judge_program
from planner.session.motion_hulls import enclose_steps, motion_hulls
from planner.session.neutral_program import session_program
from planner.session.plan_types import Waypoints, time_course
from tests.workflow.small_plan import proven_tour, small_course

CELL = "kuka-kr6-r700/edbb"


def _off(q, corners):
    """Distance of points q (n, N) from the nearest of hulls (m, K, N), by sampling each hull finely, (n,)."""
    best = np.full(len(q), np.inf)
    for hull in corners:
        flat = hull[1:] - hull[0]
        share, *_ = np.linalg.lstsq(flat.T, (q - hull[0]).T, rcond=1e-12)
        inside = (share >= -1e-9).all(axis=0) & (share.sum(axis=0) <= 1 + 1e-9)
        plane = np.where(inside, np.linalg.norm(q - hull[0] - share.T @ flat, axis=1), np.inf)
        sides = [_off_segment(q, hull[a], hull[b]) for a in range(len(hull)) for b in range(a)]
        best = np.minimum(best, np.minimum(plane, np.min(sides, axis=0)))
    return best


def _off_segment(q, a, b):
    share = np.clip((q - a) @ (b - a) / max(float((b - a) @ (b - a)), 1e-300), 0.0, 1.0)
    return np.linalg.norm(q - a - share[:, None] * (b - a), axis=1)


def _accept(corners):
    return np.ones(len(corners), dtype=bool)


@pytest.fixture(scope="module")
def cell():
    return load_cell(CELL)


@pytest.fixture(scope="module")
def moving(cell):
    """A course that passes its poses without a stop."""
    there = replace(cell, motion=replace(cell.motion, measure="continuous", both_ways=False))
    tour = proven_tour(CELL, 3)
    blend = np.full(len(tour), 0.01)
    blend[[0, -1]] = 0.0
    travel = Waypoints(round_angles(np.array([cell.home, tour[0]])), np.array([-1, 0]), np.zeros(2))
    course = time_course(there, FIRST_MOUNTING, travel, Waypoints(tour, np.array([-1, 1, 2, 3, -1]), blend))
    return there, course


def _regions(cell, program):
    chains = [c for c in recover_motion(cell, program) if c.held.attached]
    return np.concatenate([_triangles(h.corners) for c in chains for h in motion_hulls(c, cell.map_position, _accept)])


def _triangles(corners):
    """Cut hulls (m, K, N) into triangles (k, 3, N), a segment with its last point twice."""
    K = corners.shape[1]
    return np.concatenate([corners[:, [0, k, min(k + 1, K - 1)]] for k in range(1, max(K - 1, 2))])


@pytest.mark.slow
@pytest.mark.parametrize("form", [PathForm(), load_dialect("linuxcnc").path_form])
def test_the_blended_path_lies_in_the_regions_that_are_proven(moving, form):
    cell, course = moving
    program = session_program(cell, [course], "0" * 12, form)
    q = course.trajectory.angles(np.linspace(0.0, course.trajectory.duration_s, 3000))
    if form.dense:  # straight steps from point to point, whose corners are cut between their middles
        points = np.deg2rad([m.q_deg for m in program.moves if m.mounting is not None])
        middles = (points[1:] + points[:-1]) / 2
        q = np.concatenate([points, middles, (middles[1:] + middles[:-1]) / 2])
    regions = _regions(cell, program)
    assert len(regions) < 300  # small steps share them
    assert _off(q, regions).max() < (2e-7 if form.dense else 1e-9)


def _distance_left(cell, path, block_s):
    """How far a path's tool leaves the straight steps that are written of it [m]; nothing where they are refused."""
    try:
        moves, _ = dense_moves(cell, path, FIRST_MOUNTING, block_s)
    except InputError:
        return None
    q = np.vstack([path.q[:1], np.deg2rad([m.q_deg for m in moves])])
    share = np.linspace(0.0, 1.0, 40_000 // len(q) + 2)[:, None, None]
    steps = cell.map_position((q[:-1] + share * (q[1:] - q[:-1])).reshape(-1, q.shape[1]))
    driven = cell.map_position(path.trajectory.angles(np.linspace(0.0, path.trajectory.duration_s, 5000)))
    return cKDTree(steps).query(driven)[0].max()


def test_straight_steps_leave_the_path_at_blends_alone(cell, moving):
    """Straight motions from rest to rest and back are written whole by the longest blocks; of blends long ones fail."""
    tour = proven_tour(CELL, 3)
    travel = Waypoints(round_angles(np.array([cell.home, tour[0]])), np.array([-1, 0]), np.zeros(2))
    rests = Waypoints(tour, np.array([-1, 1, 2, 3, -1]), np.zeros(len(tour))).append_way_back()
    resting = time_course(cell, FIRST_MOUNTING, travel, rests).measuring
    blended_cell, course = moving
    blended = []
    for block_s in (0.02, 0.05, 0.2, 1.0, 5.0):
        assert _distance_left(cell, resting, block_s) < 2e-4  # steps are sampled 0.2 mm apart
        blended.append(_distance_left(blended_cell, course.measuring, block_s))
    assert blended[0] is not None
    assert blended[-1] is None
    assert max(left for left in blended if left is not None) < 1e-3


def test_random_curves_lie_in_the_triangles_about_their_steps():
    """Plane curves, straight lines, corners and repeats; every half step beside a corner may be cut."""
    rng = np.random.default_rng(4)
    for _ in range(20):
        frame = np.linalg.qr(rng.normal(size=(6, 6)))[0][:2]
        turn = np.cumsum(rng.choice([0.0, 0.0, 0.02, 0.6], 150))
        steps = 0.01 * np.column_stack([np.cos(turn), np.sin(turn)]) @ frame
        q = np.cumsum(steps, axis=0)
        (segments, _), (triangles, _) = enclose_steps(q, np.arange(len(q) - 1), _accept)
        regions = np.concatenate([segments[:, [0, 1, 1]], triangles])
        middles = (q[1:] + q[:-1]) / 2
        cut = (middles[1:] + middles[:-1]) / 2  # the middle of the chord that cuts each corner
        assert _off(np.concatenate([q, middles, cut]), regions).max() < 2e-7


def test_a_leg_that_is_proven_beside_a_limit_is_proven_in_small_steps_too(cell):
    """Between its ends, its tilt at the tool comes as near to the cone as planning has been seen to lead a leg."""
    room = 1.6e-5  # [rad]
    tour = proven_tour(CELL, 3)
    held = Constraints(cell.with_mount(FIRST_MOUNTING, tour[0]))
    column = [name for _, name in held.workspace.columns].index("tilt at the tool")
    share = np.linspace(0.0, 1.0, 20001)[:, None]
    legs = [(a, b) for k, a in enumerate(tour[:-1]) for b in tour[k + 1 : -1]]
    margins = [held.bounds.margins(a + share * (b - a))[:, column] for a, b in legs]
    k = next(k for k, m in enumerate(margins) if 1000 < np.argmin(m) < 19000)
    near = Constraints(
        replace(held.cell, gauge=replace(held.cell.gauge, cone_map=held.cell.gauge.cone_map - margins[k].min() + room))
    )
    (a, b), count = legs[k], int(np.ceil(np.abs(legs[k][1] - legs[k][0]).max() / 0.01))
    assert near.prove(a[None], b[None]).proven[0]
    points = a + np.linspace(0.0, 1.0, count + 1)[:, None] * (b - a)
    blend = np.full(count + 1, 1e-3)
    blend[[0, -1]] = 0.0
    number = np.arange(count)
    chain = Chain(Held(FIRST_MOUNTING, True), points, blend, np.zeros(count + 1, dtype=bool), number)
    for hulls in motion_hulls(chain, near.cell.map_position, lambda c: near.prove_corners(c).proven):
        assert near.prove_corners(hulls.corners).proven.all()
        assert near.judge(hulls.corners).proven.all()


@pytest.mark.parametrize("height", [0.0, 1e-5, 1e-4])
def test_a_narrow_corner_of_steps_takes_few_cells(height):
    """Where a blend begins beside a limit: a corner of two steps, nearly straight; the cells cover all of it."""
    path = np.array([[0.0, 0.0], [0.013, height], [0.027, 0.0]])
    q, blend = np.vstack([path[0] - [0.013, 0.0], path, path[2] + [0.013, 0.0]]), np.array([0.0, 0, 1e-3, 0, 0])
    chain = Chain(Held(FIRST_MOUNTING, True), q, blend, np.zeros(5, dtype=bool), np.arange(4))
    found = [h.corners for h in motion_hulls(chain, lambda q: np.pad(q, ((0, 0), (0, 1))), _accept)]
    cells, closed = [Neighbourhoods.of(c) for c in found if len(c)], []
    for _ in range(MOST_BISECTIONS):  # a margin that is 1.6e-5 rad where it is smallest, and grows with the square
        left = []
        for c in cells:
            lost = np.linalg.norm(c.spokes, axis=2).max(axis=1)
            proven = 1.6e-5 + 2.0 * (c.q[:, 0] - 0.006) ** 2 > lost
            closed.append(_triangles(c.corners[proven]))
            left.append(c.take(np.flatnonzero(~proven)).bisect_cells())
        cells = left
        assert sum(len(c.motion) for c in cells) < 500
    assert sum(len(c.motion) for c in cells) == 0
    inside = np.random.default_rng(0).dirichlet(np.ones(3), 200) @ path
    assert _off(inside, np.concatenate(closed)).max() < 1e-12


@pytest.mark.slow
def test_joints_on_a_circle_stay_within_its_polygon():
    cell = load_cell("comau-nj130/edbb")
    start = np.array([0.1, 0.2, -1.2, 0.3, 0.9, 0.2]) + cell.home * 0.0
    x0, R = cell.map_position(start[None])[0], cell.chain.forward(cell.robot.theta(start[None])).R[..., 0]
    angle = np.linspace(0.0, np.pi / 2, 181)
    x = x0 + 0.1 * np.column_stack([np.cos(angle) - 1.0, np.sin(angle), 0 * angle])
    q = [start]
    for point in x[1:]:
        found, good = solve_pose_ik(cell.chain, cell.robot, q[-1][None], point[None], R[None], 12)
        assert good.all()
        q.append(found[0])
    q = np.array(q)
    piece = tuple(tuple(np.rad2deg(v).tolist()) for v in (q[0], q[90], q[-1]))
    (polygon,) = circle_polygons(cell, [piece])
    points = np.vstack([q[0], np.deg2rad(polygon)])
    rounded = np.ones(len(points), dtype=bool)
    rounded[[0, -1]] = False
    chain = Chain(
        Held(FIRST_MOUNTING, True), points, np.zeros(len(points)), rounded, np.ones(len(points) - 1, dtype=int)
    )
    found = [h.corners for h in motion_hulls(chain, cell.map_position, _accept)]
    regions = np.concatenate([_triangles(c) for c in found if c.shape[1] > 2])
    assert _off(q, regions).max() < 3e-7
    with pytest.raises(NoSolutionError, match="do not come to where it ends"):
        circle_polygons(cell, [(piece[0], piece[1], tuple(np.add(piece[2], [0, 0, 0, 0, 0, 5.0])))])


def _moved(program, kind, change):
    """Change the first instruction of a kind that ``change`` takes."""
    items = list(program.instructions)
    for k, item in enumerate(items):
        if isinstance(item, kind) and (new := change(item)) is not None:
            items[k] = new
            return replace(program, instructions=tuple(items))
    raise AssertionError(kind)


@pytest.mark.parametrize("form", [PathForm(), load_dialect("linuxcnc").path_form])
def test_each_start_goes_on_where_the_robot_stands(moving, form):
    cell, course = moving
    program = session_program(cell, [course], "0" * 12, form)
    assert all(v.clear for v in judge_program(cell, program))
    ends = [e.moves[-1].q_deg for e in program.entries]
    here, passed = program.home_deg, []
    for item in program.instructions:
        if isinstance(item, Entry):
            passed.append(here)
        here = item.q_deg if isinstance(item, JointMove) else here
    assert len(ends) == 2
    assert np.abs(np.subtract(ends, passed)).max() < 1e-9

    def elsewhere(entry):
        last = entry.moves[-1]
        return replace(entry, moves=(*entry.moves[:-1], replace(last, q_deg=(last.q_deg[0] + 0.01, *last.q_deg[1:]))))

    with pytest.raises(NoSolutionError, match=r"started at 2, it goes on 0\.01 deg away from where the robot"):
        judge_program(cell, _moved(program, Entry, elsewhere))
    with pytest.raises(NoSolutionError, match="started at"):
        judge_program(cell, _moved(program, StretchBegin, lambda s: replace(s, until=1) if s.until > 1 else None))


def test_what_moves_otherwise_than_proven_is_not_released(cell):
    course = small_course(cell, proven_tour(CELL, 3))
    program = session_program(cell, [course], "0" * 12, PathForm())
    assert all(v.clear for v in judge_program(cell, program))

    def turned(move):
        return None if move.pose is None or move.mounting is None else replace(move, q_deg=(0.0, *move.q_deg[1:]))

    with pytest.raises(NoSolutionError, match=r"is not released: coal does not prove .* motions \(move \d+: "):
        judge_program(cell, _moved(program.without_starts(), JointMove, turned))
    held = replace(program, instructions=tuple(i for i in program.instructions if not isinstance(i, Pause)))
    with pytest.raises(NoSolutionError, match="the gauge is attached or taken off without a pause"):
        judge_program(cell, held.without_starts())
    away = replace(cell, home=cell.home + 0.1)
    with pytest.raises(NoSolutionError, match=r"it begins 5\.73 deg away from the cell's home"):
        judge_program(away, program)
    rail = replace(cell, home=cell.home + np.eye(len(cell.home))[0] * 0.1)
    with pytest.raises(NoSolutionError, match=r"it begins 5\.73 mm away from the cell's home"):
        judge_program(rail, replace(program, joint_units=("mm", *["deg"] * (len(cell.home) - 1))))
