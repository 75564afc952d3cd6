"""Poses without a bar: at the balls of an artifact, each approached and left the same way, or seen by a tracker.

Poses of a bar: drawn from its shell, chosen by the index, for discrimination or for tracing, and driven.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.common.determinism import Positions
from planner.common.errors import InputError, NoSolutionError
from planner.common.progress import LastStart, Stages, TimeLimit
from planner.common.summary import Aside
from planner.common.units import Array, from_mm
from planner.design.bayesian_design import choose_bayesian_poses
from planner.design.candidates.balls import BallFunnel, draw_ball_candidates
from planner.design.candidates.pool import PoseSet, draw_candidates
from planner.design.discrimination.findings import read_identification
from planner.design.discrimination.selection import select_discriminating_poses
from planner.design.fixtures.addition import add_fixtures, describe_added_fixtures
from planner.design.off_grid import refine_bayesian_poses, refine_poses
from planner.design.pose_selection import (
    PoseChoice,
    check_pose_number,
    judge_poses,
    replace_all,
    select_poses,
    traceable_pose_count,
)
from planner.design.selection.certificate import Certificate
from planner.motion.path.constraints import Constraints
from planner.motion.path.parts import connected_parts
from planner.runs.run import FIRST_MOUNTING, Samples
from planner.session.mount import (
    MountMaps,
    drop_unreachable,
    join_to_mounts,
    move_mounts,
    settle_mounts,
    with_point_mount,
)
from planner.session.options import PlanOptions
from planner.session.plan_types import Drive, Role
from planner.session.planning import PoseChooser, PoseSession, Selection
from planner.session.release import TourStop, candidate_stop
from planner.session.tolerances import REPEATED_CENTRINGS
from planner.session.tour_drive import MountingSession
from planner.session.validation_poses import order_by_distance


class BarPoses(PoseSession):
    """Where the poses of a bar come from."""

    near: Certificate
    reach: MountMaps

    def __init__(self, cell: Cell, options: PlanOptions, chooser: PoseChooser | None = None) -> None:
        super().__init__(cell, options, chooser)
        self.tracing = options.aims_at_tracing(cell)
        self.until = None if options.until_mm is None else float(from_mm(options.until_mm))
        self.poses = None if chooser else self.poses
        robot = cell.robot
        self.rivals = None
        if options.separate:
            found = Path(options.separate)
            found = found / "identification.json" if found.is_dir() else found
            self.rivals = read_identification(found, robot.name, robot.n_joints)
        if self.rivals:  # they choose the poses, whatever the cell says
            self.method = "exchange"

    def draw(self, stages: Stages) -> None:
        """Settle fixtures and mount poses, and draw the candidates, those that a path joins to them."""
        seed, limit = self.options.seed, stages.limit
        if self.options.fixtures is not None:
            with stages.stage("fixtures"):
                added = add_fixtures(self.cell, self.options.fixtures, seed, stages.say, limit)
            self.cell = added.cell
            self.notes += describe_added_fixtures(added)
        if self.poses is not None:
            check_pose_number(self.cell, self.poses, seed)
        with stages.stage("candidates") as progress:
            given = self.cell
            self.cell, found = settle_mounts(given, seed, limit)
            pool = draw_candidates(self.cell, self.cell.plan.candidates, seed, progress, limit)
        with stages.stage("roadmap"):
            reach = join_to_mounts(self.cell, pool, seed, found, limit)
            moved = move_mounts(self.cell, given, pool, reach)
            if moved is not self.cell and not limit.must_stop(LastStart.ROADMAP, "another mount pose was not tried"):
                other = draw_candidates(moved, moved.plan.candidates, seed, limit=limit)
                there = join_to_mounts(moved, other, seed, limit=limit)
                if there.joined.sum() > reach.joined.sum():
                    self.cell, pool, reach = moved, other, there
            kept = drop_unreachable(self.cell, pool, reach, self.index, self.poses, seed, limit)
            self.pool, self.reach, notes, self.near = kept
            self.notes += notes

    def select(self, stages: Stages) -> Selection:
        """Choose the poses by the index, for telling rivals apart, or for what nobody has declared."""
        cell, pool, index, seed, poses = self.cell, self.pool, self.index, self.options.seed, self.poses
        if self.tracing:
            with stages.stage("foresight") as progress:
                expected = choose_bayesian_poses(cell, pool, poses, progress, until=self.until, limit=stages.limit)
            with stages.stage("selection"):
                judged = judge_poses(cell, pool, expected.chosen, index, self.near, stages.limit)
                return Selection(judged, expected_error=expected)
        with stages.stage("selection"):
            poses = traceable_pose_count(cell, pool) if self.rivals and poses is None else poses
            choice, curve = select_poses(cell, pool, poses, index, seed, self.near, self.method, stages.limit)
        if not self.rivals:
            return Selection(choice, curve)
        with curve, stages.stage("separation"):
            parted = select_discriminating_poses(cell, pool, choice, self.rivals, seed, stages.limit)
        return Selection(parted.choice, curve, parted)

    def refine(self, chosen: Selection, stages: Stages) -> PoseChoice:
        """Replace what no path joins, then move the poses off the grid; pruned ones and those for rivals stay on it."""
        cell, seed, limit = self.cell, self.options.seed, stages.limit
        with stages.stage("refinement"):
            choice, count = replace_all(
                self.pool,
                chosen.choice,
                self._find_unjoined_poses,
                "could not be joined to the mount pose, nor those put in their places: the cable or an obstacle splits "
                "the shell into many parts; widen cable limits or choose another gauge.mount_deg",
                self._find_doubtful_candidates,
            )
            if count:
                self.notes.append(Aside(f"{count} chosen poses that no path joins to the mount pose were replaced"))
            if chosen.expected_error and cell.plan.refine:
                unknown = chosen.expected_error.unknown
                return self._move_joined_poses(
                    choice,
                    lambda c, stay: replace(c, q=refine_bayesian_poses(cell, unknown, c.samples, seed, limit, stay)),
                )
            settled = chosen.discriminating or chosen.expected_error or choice.pruning
            if settled:
                return choice
            return self._move_joined_poses(choice, lambda c, stay: refine_poses(cell, c, seed, limit, stay))

    def _move_joined_poses(self, choice: PoseChoice, move: Callable[[PoseChoice, Positions], PoseChoice]) -> PoseChoice:
        """Move the poses; those moved to where no path joins them go back to their candidates and stay there.

        The others are moved anew, since they had been chosen beside poses that are no more.
        """
        most_rounds = 4  # of moving; each leaves fewer poses that move
        stay = np.zeros(0, dtype=int)
        for _ in range(most_rounds):
            choice = move(choice, stay)
            lost = self._find_unjoined_poses(choice)
            if not len(lost):
                break
            q = choice.q.copy()
            q[lost] = choice.candidates.q[lost]
            choice, stay = replace(choice, q=q), np.union1d(stay, lost)
        return choice

    def _find_unjoined_poses(self, choice: PoseChoice) -> np.ndarray:
        """Positions of the chosen poses that are not in the part of their mount pose."""
        return self._find_unjoined_rows(choice.samples)

    def _find_doubtful_candidates(self) -> np.ndarray:
        """Positions of the candidates of which no path to their mount pose is proven: all but states of the maps.

        All are joined by their nearest states; where the shell falls into small parts, those that show most are not.
        """
        proven = np.zeros(len(self.pool), dtype=bool)
        for m, parts in self.reach.maps.items():
            mine = self.pool.samples.at_mounting(m)
            proven[mine] = parts.are_proven(self.pool.q[mine])
        return np.flatnonzero(~proven)

    def _find_unjoined_rows(self, samples: Samples) -> np.ndarray:
        lost = []
        for m in self.cell.mountings:
            mine = np.flatnonzero(samples.at_mounting(m))
            lost.append(mine[self.reach.maps[m].find_unjoined_poses(samples.q[mine], LastStart.REFINEMENT)])
        return np.concatenate(lost)

    def draw_validation(self, choice: PoseChoice) -> np.ndarray:
        """Poses for checking the fit that it never sees, far from the chosen ones, of those that a path joins.

        The pool itself was joined by a sample of it: of poses beside no path some are found only here.
        """
        others = order_by_distance(self.cell, self.pool.q, choice.chosen, self.options.seed)
        count = min(self.cell.plan.validate, len(others))
        drawn, rest = others[:count], others[count:]
        lost = self._find_unjoined_rows(self.pool.samples.take(drawn))
        if len(lost):
            more = rest[: 2 * len(lost)]
            more = np.delete(more, self._find_unjoined_rows(self.pool.samples.take(more)))
            drawn = np.append(np.delete(drawn, lost), more[: len(lost)])
        return np.sort(drawn)

    def places(self, limit: TimeLimit) -> list[MountingSession]:
        """Return each place of the bar: the poses measured there, and the path to it without the bar."""
        repeats = 0 if self.cell.motion.is_continuous else self.cell.plan.repeat
        out = []
        for m in self.cell.mountings:
            measuring, travelling = (Constraints(self.cell, m, bar, limit=limit) for bar in (True, False))
            out.append(MountingSession(measuring, travelling, self.reach.maps[m].roadmap, repeats))
        return out

    def stop(self, choice: PoseChoice, k: int) -> TourStop:
        """Return the chosen pose ``k``, with the side from which it is to be come to."""
        return TourStop(choice.q[k], "calibrate", None if choice.approach is None else choice.approach[k])

    def driven_rows(self, choice: PoseChoice, drives: tuple[Drive, ...]) -> Array:
        """Rows of the trajectory as it is driven: at the poses' closest passage when continuous, else at rest."""
        rows = []
        for d in drives:
            if self.cell.motion.is_continuous:
                q = d.trajectory.angles(np.linspace(0.0, d.trajectory.duration_s, 2000))  # samples of a drive
            else:
                q = np.array([v.q for v in d.visits if v.role == "calibrate"])
            rows.append(choice.model.rows(Samples.at(q, d.mounting)))
        return np.vstack(rows)


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
