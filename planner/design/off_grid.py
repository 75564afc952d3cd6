"""Off the grid of candidates: the chosen poses move where that betters them, and the bound is sought there as well.

Poses that the index chose are moved by :mod:`.selection.refinement`. Those that leave the smallest expected error of
the tool take turns to accept the best of trials around them, with what is known updated by the two readings
(Sherman–Morrison). Reach grows where trials succeed and shrinks where they fail.

For the bound, poses that violate its dual most are sought and joined to the candidates. A dual of
:mod:`.selection.index_bound` gives every pose a price. Between the candidates the price is a smooth function of the
joint angles. Random steps from the candidates with the lowest prices go down it, every filter kept. What they find
joins the candidates, the bound is proven over all of them anew, and so on while it moves. The bound that results is
proven for these poses, and sought, not proven, for those between them.

Off-grid refinement: the chosen poses move in joint space, all filters kept, and the index only gets better.

Around each pose trial poses are drawn, all of them in one batch. The poses then take turns to accept their best valid
trial, scored exactly against the set as it stands. Reach grows where trials succeed and shrinks where they fail. Half
of the trials are drawn further along: by the last step, and by where the good trials of the last round lay on average,
as in an evolution strategy (recombination with weights; Hansen and Ostermeier 2001).
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell
from planner.cell.workspace import SAFETY_MARGIN, Workspace
from planner.common.determinism import Positions, on_one_thread, round_significant
from planner.common.errors import InputError
from planner.common.progress import UNLIMITED, LastStart, TimeLimit
from planner.common.units import Array, read_only
from planner.design.candidates.pool import PoseSet
from planner.design.expected_errors import ExpectedErrors
from planner.design.observability.information import find_rule
from planner.design.pose_selection import PoseChoice
from planner.design.selection.certificate import Certificate, Dual
from planner.design.selection.index_bound import WholePool, certify_bound
from planner.design.selection.index_criterion import BarrierPotential, SwapTable, eigenvalues, index_of_rows, is_exact
from planner.design.selection.matrix_forms import information_matrix
from planner.model.model import Model
from planner.motion.collision.engines import CollisionWorld
from planner.runs.run import Samples

FIRST_REACH = 0.2  # [rad] of a trial at first
LEAST_REACH = 1e-4  # [rad] a pose whose trials reach no farther rests

RowsOf = Callable[[Array, np.ndarray], Array]
Valid = Callable[[Array, np.ndarray], "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]"]


@on_one_thread
def refine_off_grid(
    q0: Array,
    rows_of: RowsOf,
    valid: Valid,
    index: str = "O2",
    seed: int = 0,
    rounds: int = 30,
    limit: TimeLimit = UNLIMITED,
) -> Array:
    """Return poses (n, N) [rad] near ``q0`` (n, N) [rad] with a better index.

    ``rows_of`` maps joint angles (m, N) to rows (m, r, P), reduced and scaled as the selection's; ``valid`` tells (m,)
    which joint angles pass every filter. Both are told (m,) of which pose each is a trial. ``rounds`` of trials at
    each of four barrier strengths. Deterministic. The result is ``q0`` itself when nothing better is found.

    Raises:
        InputError: a starting pose is not valid.
    """
    find_rule(index)
    q0 = np.asarray(q0, dtype=float)
    own = np.arange(len(q0))
    fine = np.asarray(valid(q0, own), dtype=bool)
    if not fine.all():
        raise InputError(
            f"pose {int(np.flatnonzero(~fine)[0])} does not pass the filters: refinement starts from valid poses"
        )
    rng = np.random.default_rng(seed)
    q, rows = q0.copy(), rows_of(q0, own)
    best = q, rows, index_of_rows(index, rows)
    strengths = (0.1, 0.03, 0.01, 0.003)  # of the barriers, one after the other
    for strength in strengths if index not in ("O1", "O5") else strengths[:1]:
        reach, lead = np.full(len(q), FIRST_REACH), np.zeros_like(q)
        for _ in range(rounds):
            potential = BarrierPotential(index, strength)
            q, rows, reach, lead = _run_round(q, rows, reach, lead, rows_of, valid, potential, rng)
            value = index_of_rows(index, rows)
            if find_rule(index).is_better(value, best[2]):
                best = q, rows, value
            if np.mean(reach > LEAST_REACH) < 0.05:  # of the poses still move: they are left there
                break
            if limit.must_stop(LastStart.REFINEMENT, "the poses were refined off the grid only in part"):
                break
        q, rows = best[0], best[1]
    return read_only(best[0])


def _run_round(
    q: Array,
    rows: Array,
    reach: Array,
    lead: Array,
    rows_of: RowsOf,
    valid: Valid,
    potential: BarrierPotential,
    rng: np.random.Generator,
) -> tuple[Array, Array, Array, Array]:
    """One batch of trials around every pose that still gains by some, then a turn for each.

    ``lead`` (n, N) [rad] is where half of the trials are led; that of the next round is returned with the poses.
    """
    trials = 24  # around each pose in a round
    joints, busy = q.shape[1], np.flatnonzero(reach > LEAST_REACH)
    step = rng.standard_normal((len(busy), trials, joints)) / np.sqrt(joints)
    trial = q[busy, None] + reach[busy, None, None] * step
    trial[:, :12] += lead[busy, None]  # the first half is led on by what helped before
    which = np.repeat(busy, trials).reshape(-1, trials)
    trial_rows = rows_of(trial.reshape(-1, joints), which.ravel()).reshape(*which.shape, *rows.shape[1:])
    scores = (SwapTable if is_exact(rows, potential.index) else _MassScores)(rows, potential)
    gains = scores.of_each(busy, trial_rows)
    hopeful = gains > 0
    passed = np.zeros(gains.shape, dtype=bool)
    if hopeful.any():
        passed[hopeful] = valid(trial[hopeful], which[hopeful])
    good, start = np.where(passed, gains, 0.0), q
    q, rows, reach = q.copy(), rows.copy(), reach.copy()
    for turn in np.argsort(-np.max(good, axis=1), kind="stable"):
        k, fine = busy[turn], passed[turn]
        gain = np.where(fine, scores.of_one(k, trial_rows[turn]), -np.inf) if fine.any() else gains[turn]
        best = int(np.argmax(gain))
        if fine.any() and gain[best] > 1e-10:
            q[k], rows[k] = trial[turn, best], trial_rows[turn, best]
            scores.exchange(k, rows[k])
            reach[k] *= 1.4
        else:
            reach[k] *= 0.7
    share = good / np.maximum(good.sum(axis=1, keepdims=True), 1e-300)
    lead = 0.3 * (q - start)
    # 0.3 of the last step, and 1.4 times the mean of the good trials
    lead[busy] += 1.4 * np.einsum("kt,ktj->kj", share, trial - start[busy, None])
    return q, rows, np.clip(reach, LEAST_REACH / 2, 2 * FIRST_REACH), lead


class _MassScores:
    """A :class:`SwapTable` by the eigenvalues after each trial, for poses with several readings."""

    def __init__(self, rows: Array, potential: BarrierPotential) -> None:
        self.rows, self.potential = rows.copy(), potential
        self._settle()

    def of_each(self, members: Positions, trials: Array) -> Array:
        """Gains (m, T) of the own trials (m, T, r, P) of each of the poses ``members`` (m,)."""
        return np.array([self.of_one(int(k), each) for k, each in zip(members, trials, strict=True)])

    def of_one(self, position: int, trials: Array) -> Array:
        """Gains (T,) when the pose at ``position`` becomes each of ``trials`` (T, r, P)."""
        after = self.mass - information_matrix(self.rows[position : position + 1]) + np.swapaxes(trials, 1, 2) @ trials
        return np.asarray(self.potential.barrier(eigenvalues(after), *self.shifts) - self.now)

    def exchange(self, position: int, row: Array) -> None:
        """Take ``row`` (r, P) for the pose at ``position``."""
        self.rows[position] = row
        self._settle()

    def _settle(self) -> None:
        self.mass = information_matrix(self.rows)
        mu = eigenvalues(self.mass)
        self.shifts = self.potential.shifts(mu)
        self.now = self.potential.barrier(mu, *self.shifts)


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
