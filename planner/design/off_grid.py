"""Off the grid of candidates: the chosen poses move where that betters them, and the bound is sought there as well.

Poses that the index chose are moved by :mod:`.selection.refinement`. Those that leave the smallest expected error of
the tool take turns to accept the best of trials around them, with what is known updated by the two readings
(Sherman–Morrison). Reach grows where trials succeed and shrinks where they fail.

For the bound, poses that violate its dual most are sought and joined to the candidates. A dual of
:mod:`.selection.index_bound` gives every pose a price. Between the candidates the price is a smooth function of the
joint angles. Random steps from the candidates with the lowest prices go down it, every filter kept. What they find
joins the candidates, the bound is proven over all of them anew, and so on while it moves. The bound that results is
proven for these poses, and sought, not proven, for those between them.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell
from planner.cell.workspace import SAFETY_MARGIN, Workspace
from planner.common.determinism import Positions, on_one_thread, round_significant
from planner.common.progress import UNLIMITED, LastStart, TimeLimit
from planner.common.units import Array
from planner.design.candidates.pool import PoseSet
from planner.design.expected_errors import ExpectedErrors
from planner.design.pose_selection import PoseChoice
from planner.design.selection.certificate import Certificate, Dual
from planner.design.selection.index_bound import WholePool, certify_bound
from planner.design.selection.refinement import refine_off_grid
from planner.model.model import Model
from planner.motion.collision.engines import CollisionWorld
from planner.runs.run import Samples


class CandidateFilters:
    """Every filter that a candidate passes, for states q (m, N) [rad] in the place of the samples ``which`` (m,)."""

    def __init__(self, cell: Cell, samples: Samples) -> None:
        self._held = [
            (samples.at_mounting(m), Workspace(cell, m), CollisionWorld.from_cell(cell, m)) for m in cell.mountings
        ]
        self._clearance = cell.motion.clearance + SAFETY_MARGIN

    def __call__(self, q: Array, which: np.ndarray) -> np.ndarray:
        """Tell which states keep all filters, (m,) bool."""
        ok = self.keep_limits(q, which)
        ok[ok] = self._filter_each(q[ok], which[ok], lambda _, world, mine: ~world.collides(mine, self._clearance))
        return ok

    def keep_limits(self, q: Array, which: np.ndarray) -> np.ndarray:
        """Tell which states keep the limits of joints, gauge and cable, (m,) bool."""
        return self._filter_each(q, which, lambda workspace, _, mine: workspace.keeps_margin(mine, SAFETY_MARGIN))

    def are_free(self, q: Array, which: np.ndarray) -> np.ndarray:
        """Tell which collide with nothing, one by one: a copy of the process must not start OpenMP's threads."""
        return self._filter_each(q, which, lambda _, world, mine: ~world.find_near(mine, self._clearance))

    def _filter_each(
        self, q: Array, which: np.ndarray, keeps: Callable[[Workspace, CollisionWorld, Array], np.ndarray]
    ) -> np.ndarray:
        ok = np.zeros(len(q), dtype=bool)
        for held, workspace, world in self._held:
            mine = np.flatnonzero(held[which])
            ok[mine] = keeps(workspace, world, q[mine])
        return ok


Filter = Callable[[Array, np.ndarray], np.ndarray]  # of states (m, N) [rad] in the place of the poses (m,): (m,) bool


def _keep_in_place(valid: Filter, q: Array, stay: Positions | None) -> Filter:
    """Return the filter by which the poses ``stay`` of q (n, N) [rad] may be nowhere but where they are."""
    stays = np.zeros(len(q), dtype=bool)
    if stay is not None:
        stays[stay] = True
    return lambda tried, which: valid(tried, which) & (~stays[which] | (tried == q[which]).all(axis=1))


def refine_poses(
    cell: Cell, choice: PoseChoice, seed: int, limit: TimeLimit = UNLIMITED, stay: Positions | None = None
) -> PoseChoice:
    """Move the chosen poses continuously to better the index, each on its own fixture and keeping every filter.

    The poses ``stay`` (k,) are left where they are.
    """
    if not cell.plan.refine or choice.ball is not None:
        return choice

    def rows(states: Array, pose: np.ndarray) -> Array:
        """Return the Jacobian's rows of states (m, N) in the place of the poses (m,)."""
        return choice.model.rows(replace(choice.samples.take(pose), q=states))

    valid = _keep_in_place(CandidateFilters(cell, choice.samples), choice.q, stay)
    return replace(choice, q=refine_off_grid(choice.q, rows, valid, choice.index, seed=seed, limit=limit))


@on_one_thread
def refine_bayesian_poses(
    cell: Cell,
    unknown: ExpectedErrors,
    samples: Samples,
    seed: int,
    limit: TimeLimit = UNLIMITED,
    stay: Positions | None = None,
) -> Array:
    """Return poses (n, N) [rad] near those of ``samples``, in their order, that leave a smaller expected error.

    The poses ``stay`` (k,) are left where they are.
    """
    shorter = 0.7  # times the reach after a failure
    longer = 1.2  # times the reach after a success
    trials = 12  # around each pose in a round
    rng, q = np.random.default_rng(seed), samples.q.copy()
    valid = _keep_in_place(CandidateFilters(cell, samples), samples.q, stay)
    # 0.2: [rad] of a trial at first
    white, weight, reach = unknown.white(samples), unknown.weight_per_prior, np.full(len(q), 0.2)
    for _ in range(16):  # rounds of trials around every pose
        if limit.must_stop(LastStart.REFINEMENT, "the poses were refined off the grid only in part"):
            break
        steps = rng.normal(size=(len(q), trials, q.shape[1])) * rng.random((len(q), trials, 1))
        tried = (q[:, None] + reach[:, None, None] * steps).reshape(-1, q.shape[1])
        of = np.repeat(np.arange(len(q)), trials)
        kept = np.flatnonzero(valid(tried, of))
        tried, of = tried[kept], of[kept]
        taken = _accept_trials(white, unknown.white(replace(samples.take(of), q=tried)), of, weight)
        moved = of[taken]
        q[moved] = tried[taken]
        reach *= shorter
        reach[moved] *= longer / shorter
    return q


def _accept_trials(white: Array, trials: Array, of: np.ndarray, weight: Array) -> np.ndarray:
    """Put into ``white`` (n, P), one pose after the other, the best of its ``trials`` (m, P); return which, (k,).

    With what is known without the pose's own reading, C, a reading a takes a C W C aᵀ / (1 + a C aᵀ) off the mean
    square error (see :mod:`.bayesian_design`).
    """
    covariance: Array = np.asarray(np.linalg.inv(white.T @ white + np.eye(white.shape[1])))
    taken = list[int]()
    for k in range(len(white)):
        mine = np.flatnonzero(of == k)
        own = covariance @ white[k]
        covariance = covariance + np.outer(own, own) / (1.0 - white[k] @ own)
        rows = np.concatenate([white[k : k + 1], trials[mine]])
        seen = rows @ covariance
        gain = np.einsum("ij,ij->i", seen @ weight, seen) / (1.0 + np.einsum("ij,ij->i", seen, rows))
        best = int(np.argmax(round_significant(gain)))
        if best:
            taken.append(int(mine[best - 1]))
            white[k] = rows[best]
        covariance = covariance - np.outer(seen[best], seen[best]) / (1.0 + seen[best] @ rows[best])
    return np.array(taken, dtype=int)


MOST_DESCENTS = 6  # from the candidates of lowest price, before the bound is taken as it is


@on_one_thread
def certify_off_grid(cell: Cell, pool: PoseSet, choice: PoseChoice, limit: TimeLimit = UNLIMITED) -> Certificate:
    """Bound the sets of candidates, of poses as chosen off the grid, and of those that descents find beside them.

    The certificate of the candidates alone is returned where the poses were not moved off the grid. It may be done in
    a copy of the process.
    """
    found = choice.certificate
    if choice.value == choice.on_grid_value:
        return found
    samples = Samples.concatenate([pool.samples, choice.samples])
    rows = choice.model.rows(samples)
    for number in range(MOST_DESCENTS):
        before = found.value
        found = certify_bound(rows, choice.index, found.poses, 1e-3, near=found, limit=limit)  # [1] of the bound
        settled = number > 0 and abs(found.value / before - 1.0) < 2e-3  # relative move of the bound
        if (
            settled
            or number == MOST_DESCENTS - 1
            or limit.must_stop(LastStart.BOUND, "poses off the grid were sought only in part")
        ):
            break
        duals = [d for d in found.duals if not isinstance(d, WholePool)]
        more = [_descend_price(cell, choice.model, samples, rows, found.support, d, number) for d in duals]
        samples = Samples.concatenate([samples, *more])
        rows = np.concatenate([rows, *(choice.model.rows(s) for s in more)])
    return found


def _descend_price(
    cell: Cell, model: Model, samples: Samples, rows: Array, support: Positions, dual: Dual, seed: int
) -> Samples:
    """Return the poses to which random steps lead down the price of a dual, from the samples of lowest price.

    Args:
        cell, model: what decides whether a pose can be measured, and what it shows.
        samples, rows: the candidates and what they show.
        support: of the bound, by which the dual is scaled.
        dual: whose price goes down.
        seed: of the steps.
    """
    narrower = 0.93  # times the reach after a failure
    wider = 1.3  # times the reach after a success
    first = round_significant(dual.prices(rows, support))
    start = samples.take(np.lexsort((np.arange(len(first)), first))[:400])  # samples of the lowest price
    valid, scale, rng = CandidateFilters(cell, start), rows[support], np.random.default_rng(seed)

    def price(which: np.ndarray, q: Array) -> Array:
        """Return the price of states (m, N) in the place of the samples ``which`` (m,)."""
        shown = np.concatenate([scale, model.rows(replace(start.take(which), q=q))])
        return round_significant(dual.prices(shown, np.arange(len(scale)))[len(scale) :])

    every = np.arange(len(start))
    q, reach, best = start.q.copy(), np.full(len(start), 0.15), price(every, start.q)  # [rad] of a step at first
    for _ in range(60):  # steps: where none succeeds, the reach has shrunk to a hundredth
        tried = q + rng.normal(size=q.shape) * reach[:, None]
        which = np.flatnonzero(valid.keep_limits(tried, every))
        now = price(which, tried[which])
        lower = now < best[which]
        which, now = which[lower], now[lower]
        free = valid.are_free(tried[which], which)
        which, now = which[free], now[free]
        reach *= narrower
        q[which], best[which] = tried[which], now
        reach[which] *= wider / narrower
    return replace(start, q=q)
