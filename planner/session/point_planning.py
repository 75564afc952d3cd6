"""``plan()`` for gauges without a bar: poses at an artifact's balls, or poses that a tracker sees."""

from dataclasses import astuple, replace

import numpy as np

from planner.cell.cell import Cell
from planner.common.determinism import on_one_thread
from planner.common.errors import InputError, NoSolutionError
from planner.design.candidates.balls import draw_ball_candidates
from planner.design.candidates.pool import BeamFunnel, PoseSet, draw_candidates
from planner.design.observability.information import index_value
from planner.design.pose_selection import PoseChoice, judge_given_poses, select_poses
from planner.motion.path.constraints import Constraints
from planner.motion.path.roadmap import connected_parts
from planner.session.bar_drive import Unreachable
from planner.session.bar_planning import REPLACEMENTS, PlanOptions, Stages, program_files
from planner.session.mount import with_point_mount
from planner.session.notes import session_notes
from planner.session.plan_file import plan_hash
from planner.session.plan_types import Drive, Plan, Role
from planner.session.point_drive import PointStop, drive_points
from planner.session.replacement import replace_pose

CENTRINGS = 3  # of a pose that is repeated (TriCal paper, Table 3)
ROUNDS = 8


@on_one_thread
def plan_points(cell: Cell, options: PlanOptions, stages: Stages) -> Plan:
    """Plan a measuring session at balls or for a tracker.

    Raises:
        InputError: the cell or an option is wrong.
        NoSolutionError: a stage has no solution; the message says which.
    """
    dialects = options.known_dialects(cell)
    index, poses = options.index or cell.plan.index, options.poses or cell.plan.poses
    if cell.gauge.head is not None:
        _check_shares(cell, poses, index)
    with stages.stage("candidates") as progress:
        away = Constraints(cell, bar=False)
        draw = draw_candidates if cell.gauge.head is None else draw_ball_candidates
        pool = draw(cell, cell.plan.candidates, options.seed, progress)
        if cell.gauge.head is None:
            pool = replace(pool, funnel=BeamFunnel(*astuple(pool.funnel)))
        cell = with_point_mount(cell, away, options.seed, pool.q if cell.gauge.head is None else None)
        away = Constraints(cell, bar=False, scene=away.scene)
    with stages.stage("roadmap"):
        pool, notes = _drop_unreachable(cell, away, pool, options.seed)
    with stages.stage("selection"):
        if _only_validates(cell, options):
            chosen = _draw_poses(pool, cell.plan.validate, options.seed)
            choice, curve = judge_given_poses(cell, pool, chosen, index, options.seed)
        else:
            choice, curve = select_poses(cell, pool, poses, index, options.seed)
    with curve, stages.stage("path"):
        drive, choice, more = _drive_tour(cell, away, pool, choice, options)
    with stages.stage("index curve"):
        points = curve.result()
    with stages.stage("programs"):
        driven = index_value(choice.index, choice.model.jacobian(choice.q, choice.fixture))
        bare = Plan("0" * 12, cell, options.seed, pool, choice, points, (drive,), driven, (), notes + more)
        named = replace(bare, plan_id=plan_hash(bare))
        told = session_notes(cell, (drive.course,), named.plan_id, dialects)
        return replace(
            named, programs=tuple((n, program_files(named, n)) for n in dialects), notes=(*named.notes, *told)
        )


def _check_shares(cell: Cell, poses: int | None, index: str) -> None:
    """Refuse, before a minute's work, what balls cannot share."""
    if index != "O1":
        raise InputError(f"poses at balls are shared out by DETMAX on O1 (TriCal paper, section 5); found {index}")
    if poses is None:
        raise InputError(f"{cell.path}: the key 'plan.poses' is missing: how many poses the balls share")
    if poses % len(cell.balls):
        raise InputError(f"{poses} poses cannot be shared evenly between {len(cell.balls)} balls: ask for a multiple")


def _drop_unreachable(cell: Cell, away: Constraints, pool: PoseSet, seed: int) -> tuple[PoseSet, tuple[str, ...]]:
    """Keep the candidates that a path joins to the mount pose; a note says how many others there were."""
    near = pool.q if pool.back is None else pool.back
    part = connected_parts(away, np.vstack([np.asarray(cell.fixtures[0].mount), near]), seed)
    kept = np.flatnonzero(part[1:] == part[0])
    if not len(kept):
        raise NoSolutionError(
            "no way leads from where the session starts to any candidate pose: give another gauge.mount_deg, or lower "
            "motion.clearance_mm"
        )
    lost = len(pool) - len(kept)
    funnel = pool.funnel
    notes = [f"{lost} of {len(pool)} candidates cannot be reached from where the session starts; left out"]
    notes = notes if lost else []
    if pool.ball is not None and (far := getattr(funnel, "approach", 0) - getattr(funnel, "contact", 0)):
        notes.append(f"{far} poses were left out: the uncalibrated robot might meet the ball further off than it may")
    return pool.take(kept), tuple(notes)


def _drive_tour(
    cell: Cell, away: Constraints, pool: PoseSet, choice: PoseChoice, options: PlanOptions
) -> tuple[Drive, PoseChoice, tuple[str, ...]]:
    """Drive the tour; a pose that no path joins is replaced after all, and told."""
    choice = _replace_untouchable(away, pool, choice)
    only = _only_validates(cell, options)
    checks = (
        np.zeros(0, dtype=int) if only else _draw_validation_poses(away, pool, choice, cell.plan.validate, options.seed)
    )
    again = frozenset[int]() if pool.ball is None else _choose_repeats(choice, cell.plan.repeat)
    repeats = cell.plan.repeat if pool.ball is None else 0
    role: Role = "validate" if only else "calibrate"
    notes: list[str] = []
    for _ in range(REPLACEMENTS):
        stops = [_stop(pool, int(k), role, CENTRINGS if i in again else 1) for i, k in enumerate(choice.chosen)]
        stops += [_stop(pool, int(k), "validate") for k in checks]
        try:
            drive = drive_points(cell, away, stops, repeats, pool, options.tsp, options.seed)
        except Unreachable as lost:
            if lost.which < len(choice.chosen):
                choice = _replace_untouchable(away, pool, replace_pose(pool, choice, lost.which))
            else:
                checks = np.delete(checks, lost.which - len(choice.chosen))
            notes.append("a pose that no path could join was replaced")
            continue
        return drive, choice, (*notes, *drive.tour.notes)
    raise NoSolutionError(f"{REPLACEMENTS} poses in a row could not be joined to the tour: obstacles split the cell")


def _only_validates(cell: Cell, options: PlanOptions) -> bool:
    """A tracker measures poses for calibration only where their number is asked for."""
    return cell.gauge.kind == "tracker" and not (options.poses or cell.plan.poses)


def _draw_poses(pool: PoseSet, count: int, seed: int) -> np.ndarray:
    """Positions of poses drawn blindly from the candidates.

    Raises:
        NoSolutionError: there are fewer.
    """
    if len(pool) < count:
        raise NoSolutionError(
            f"only {len(pool)} candidate poses are left for {count} to validate with: raise plan.candidates, or widen "
            "gauge.cone_deg"
        )
    return np.sort(np.random.default_rng([seed, 1]).permutation(len(pool))[:count])


def _stop(pool: PoseSet, k: int, role: Role, times: int = 1) -> PointStop:
    if pool.ball is None or pool.back is None:
        return PointStop(pool.q[k], role)
    return PointStop(pool.q[k], role, int(pool.ball[k]), pool.back[k], times)


def _replace_untouchable(away: Constraints, pool: PoseSet, choice: PoseChoice) -> PoseChoice:
    """Replace chosen poses whose last way to the ball is not proven.

    Raises:
        NoSolutionError: replacements are not proven either, again and again.
    """
    for _ in range(ROUNDS):
        lost = np.flatnonzero(~_prove_touch(away, pool, choice.chosen))
        if not len(lost):
            return choice
        for k in lost:
            choice = replace_pose(pool, choice, int(k))
    raise NoSolutionError(
        f"the last way to the ball could not be proven for {len(lost)} poses, nor for those put in their places: lower "
        "motion.clearance_mm a little, or change gauge.head.approach_mm"
    )


def _prove_touch(away: Constraints, pool: PoseSet, rows: np.ndarray) -> np.ndarray:
    """Tell for which candidates the straight joint motion from the approach pose to the ball is proven, (n,) bool."""
    out = np.ones(len(rows), dtype=bool)
    if pool.ball is None or pool.back is None:
        return out
    for ball in np.unique(pool.ball[rows]):
        mine = np.flatnonzero(pool.ball[rows] == ball)
        at, corners = away.at_ball(int(ball)), np.stack([pool.back[rows[mine]], pool.q[rows[mine]]], axis=1)
        out[mine] = at.prove_corners(corners).proven & at.judge(corners).proven
    return out


def _draw_validation_poses(away: Constraints, pool: PoseSet, choice: PoseChoice, count: int, seed: int) -> np.ndarray:
    """Poses for checking the fit that it never sees: drawn blindly, none of them chosen, as many at each ball."""
    others = np.random.default_rng(seed).permutation(np.setdiff1d(np.arange(len(pool)), choice.chosen))
    if pool.ball is None:
        return np.sort(others[:count])
    balls = int(pool.ball.max()) + 1
    found: list[int] = []
    for ball in range(balls):
        share = len(range(ball, count, balls))
        mine = others[pool.ball[others] == ball][: 3 * share]
        found += mine[_prove_touch(away, pool, mine)][:share].tolist()
    return np.sort(np.array(found, dtype=int))


def _choose_repeats(choice: PoseChoice, count: int) -> frozenset[int]:
    """Positions of the chosen poses that are centred several times: ball after ball, the most telling first."""
    assert choice.ball is not None
    rows = choice.model.jacobian(choice.q, choice.fixture)
    inverse = np.linalg.inv(np.einsum("nrp,nrq->pq", rows, rows))
    weight = np.einsum("nrp,pq,nrq->n", rows, inverse, rows)
    rank = np.empty(len(weight), dtype=int)
    for ball in np.unique(choice.ball):
        mine = np.flatnonzero(choice.ball == ball)
        rank[mine[np.argsort(-weight[mine], kind="stable")]] = np.arange(len(mine))
    order = np.lexsort((choice.ball, rank))
    return frozenset(int(k) for k in order[:count])
