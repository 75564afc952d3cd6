"""Poses without a bar: at the balls of an artifact, each approached and left the same way, or seen by a tracker."""

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import InputError, NoSolutionError
from planner.common.progress import Stages, TimeLimit
from planner.common.summary import Aside
from planner.common.units import Array
from planner.design.candidates.balls import BallFunnel, draw_ball_candidates
from planner.design.candidates.pool import PoseSet, draw_candidates
from planner.design.pose_selection import PoseChoice, judge_poses, replace_all, select_poses
from planner.motion.path.constraints import Constraints
from planner.motion.path.parts import connected_parts
from planner.runs.run import FIRST_MOUNTING
from planner.session.course import Role
from planner.session.mount import with_point_mount
from planner.session.options import PlanOptions
from planner.session.plan_types import Drive
from planner.session.planning import PoseChooser, PoseSession, Selection
from planner.session.release import TourStop, candidate_stop
from planner.session.tolerances import REPEATED_CENTRINGS
from planner.session.tour_drive import MountingSession
from planner.session.validation_poses import order_by_distance


class PointPoses(PoseSession):
    """Where poses without a bar come from."""

    away: Constraints
    repeated: frozenset[int] = frozenset()

    def __init__(self, cell: Cell, options: PlanOptions, chooser: PoseChooser | None = None) -> None:
        super().__init__(cell, options, chooser)
        self.at_balls = cell.gauge.at_balls
        self.only_validates = bool(cell.gauge.validates_with) and not (self.poses or self.options.method or chooser)
        if self.at_balls and chooser is None:
            _check_shares(cell, self.poses, self.index)

    def draw(self, stages: Stages) -> None:
        """Draw the candidates and settle where the session starts; keep those that a path joins to it."""
        seed, limit = self.options.seed, stages.limit
        with stages.stage("candidates") as progress:
            self.away = Constraints(self.cell, bar=False, limit=limit)
            if self.at_balls:
                pool = draw_ball_candidates(self.cell, self.cell.plan.candidates, seed, progress)
            else:
                pool = draw_candidates(self.cell, self.cell.plan.candidates, seed, progress, limit)
            starts = self.cell.gauge.start_states(_passed_states(pool))
            self.cell = with_point_mount(self.cell, self.away, seed, starts)
            self.away = Constraints(self.cell, bar=False, scene=self.away.scene, limit=limit)
        with stages.stage("roadmap"):
            self.pool = self._keep_reachable(pool)

    def _keep_reachable(self, pool: PoseSet) -> PoseSet:
        """Keep the candidates that a path joins to the mount pose; a note says how many others there were."""
        mount = np.asarray(self.cell.mount(FIRST_MOUNTING))
        part = connected_parts(self.away, np.vstack([mount, _passed_states(pool)]), self.options.seed)
        kept = np.flatnonzero(part[1:] == part[0])
        if not len(kept):
            raise NoSolutionError(
                "no path leads from where the session starts to any candidate pose: give another gauge.mount_deg, or "
                "lower motion.clearance_mm"
            )
        if lost := len(pool) - len(kept):
            said = f"{lost} of {len(pool)} candidates cannot be reached from where the session starts; left out"
            self.notes.append(Aside(said))
        funnel = pool.funnel
        if isinstance(funnel, BallFunnel) and (far := funnel.approach - funnel.contact):
            self.notes.append(Aside(f"{far} poses were left out: {funnel.missed}"))
        return pool.take(kept)

    def select(self, stages: Stages) -> Selection:
        """Choose the poses by the index; by chance where they only validate."""
        cell, pool, index, seed = self.cell, self.pool, self.index, self.options.seed
        with stages.stage("selection"):
            if not self.only_validates:
                chosen = select_poses(cell, pool, self.poses, index, seed, method=self.method, limit=stages.limit)
                return Selection(*chosen)
            asked = "validate_" in cell.file.plan.model_fields_set
            count = cell.plan.validate if asked else cell.gauge.validates_with
            return Selection(judge_poses(cell, pool, _draw_poses(pool, count, seed), index, limit=stages.limit))

    def refine(self, chosen: Selection, stages: Stages) -> PoseChoice:
        """Replace poses whose last way to the ball is not proven; settle which are centred several times."""
        with stages.stage("path"):
            choice = self._keep_touchable(chosen.choice)
        if self.at_balls:
            self.repeated = _choose_repeats(choice, self.cell.plan.repeat)
        return choice

    def _keep_touchable(self, choice: PoseChoice) -> PoseChoice:
        choice, _ = replace_all(
            self.pool,
            choice,
            lambda c: np.flatnonzero(~self._prove_touch(c.chosen)),
            "and those put in their places have a last path to the ball that could not be proven: lower "
            "motion.clearance_mm a little, or change the gauge's approach_mm",
        )
        return choice

    def _prove_touch(self, rows: np.ndarray) -> np.ndarray:
        """Tell for which candidates the straight joint motion from the approach pose to the ball is proven, (n,)."""
        out, pool = np.ones(len(rows), dtype=bool), self.pool
        if pool.ball is None or pool.back is None:
            return out
        for ball in np.unique(pool.ball[rows]):
            mine = np.flatnonzero(pool.ball[rows] == ball)
            corners = np.stack([pool.back[rows[mine]], pool.q[rows[mine]]], axis=1)
            out[mine] = self.away.at_ball(int(ball)).prove_by_both_engines(corners)
        return out

    def draw_validation(self, choice: PoseChoice) -> np.ndarray:
        """Poses for checking the fit that it never sees, far from the chosen ones, as many at each ball."""
        pool, count = self.pool, self.cell.plan.validate
        if self.only_validates:
            return np.zeros(0, dtype=int)
        others = order_by_distance(self.cell, pool.q, choice.chosen, self.options.seed)
        if pool.ball is None:
            return np.sort(others[:count])
        balls = int(pool.ball.max()) + 1
        found: list[int] = []
        for ball in range(balls):
            share = len(range(ball, count, balls))
            mine = others[pool.ball[others] == ball][: 3 * share]
            found += mine[self._prove_touch(mine)][:share].tolist()
        return np.sort(np.array(found, dtype=int))

    def places(self, limit: TimeLimit) -> list[MountingSession]:
        """Return the one place from which everything is measured; balls are repeated in a row, not at the end."""
        repeats = 0 if self.at_balls else self.cell.plan.repeat
        return [MountingSession(self.away, self.away, _passed_states(self.pool), repeats)]

    def stop(self, choice: PoseChoice, k: int) -> TourStop:
        """Return the chosen pose ``k``, with the number of centrings where there is a ball."""
        role: Role = "validate" if self.only_validates else "calibrate"
        return candidate_stop(self.pool, int(choice.chosen[k]), role, REPEATED_CENTRINGS if k in self.repeated else 1)

    def replace(self, choice: PoseChoice, lost: int, gone: np.ndarray) -> PoseChoice:
        """Replace a chosen pose that no path joins, by none of the candidates that are ``gone``."""
        return self._keep_touchable(super().replace(choice, lost, gone))

    def driven_rows(self, choice: PoseChoice, drives: tuple[Drive, ...]) -> Array:
        """Rows of the chosen poses: the robot rests at each."""
        return choice.model.rows(choice.samples)


def _passed_states(pool: PoseSet) -> Array:
    """States that a tour passes, (n, N) [rad]: the candidates, at balls the poses that they are approached from."""
    return pool.q if pool.back is None else pool.back


def _check_shares(cell: Cell, poses: int | None, index: str) -> None:
    """Refuse, before a minute's work, what balls cannot share."""
    if index != "O1":
        raise InputError(f"poses at balls are shared out by DETMAX on O1 (TriCal paper, section 5); found {index}")
    if poses is None:
        raise InputError(f"{cell.path}: the key 'plan.poses' is missing: how many poses the balls share")
    if poses % len(cell.balls):
        raise InputError(f"{poses} poses cannot be shared evenly between {len(cell.balls)} balls: ask for a multiple")


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


def _choose_repeats(choice: PoseChoice, count: int) -> frozenset[int]:
    """Positions of the chosen poses that are centred several times: ball after ball, the most telling first."""
    assert choice.ball is not None
    rows = choice.model.rows(choice.samples)
    inverse = np.linalg.inv(np.einsum("nrp,nrq->pq", rows, rows))
    weight = np.einsum("nrp,pq,nrq->n", rows, inverse, rows)
    rank = np.empty(len(weight), dtype=int)
    for ball in np.unique(choice.ball):
        mine = np.flatnonzero(choice.ball == ball)
        rank[mine[np.argsort(-weight[mine], kind="stable")]] = np.arange(len(mine))
    order = np.lexsort((choice.ball, rank))
    return frozenset(int(k) for k in order[:count])
