"""Off-grid refinement: the chosen poses move in joint space, all filters kept, and the index only gets better.

Around each pose trial poses are drawn, all of them in one batch. The poses then take turns to accept their best valid
trial, scored exactly against the set as it stands. Reach grows where trials succeed and shrinks where they fail. Half
of the trials are drawn further along: by the last step, and by where the good trials of the last round lay on average,
as in an evolution strategy (recombination with weights; Hansen and Ostermeier 2001).
"""

from collections.abc import Callable

import numpy as np

from planner.common.determinism import Positions, on_one_thread
from planner.common.errors import InputError
from planner.common.progress import UNLIMITED, LastStart, TimeLimit
from planner.common.units import Array, read_only
from planner.design.observability.information import find_rule
from planner.design.selection.index_criterion import (
    BarrierPotential,
    SwapTable,
    eigenvalues,
    index_of_rows,
    is_exact,
)
from planner.design.selection.matrix_forms import information_matrix

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
