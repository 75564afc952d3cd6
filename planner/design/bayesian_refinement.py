"""Off the grid of candidates for the expected error of the tool: each chosen pose moves while that error falls.

Around each pose trial poses are drawn, all of them in one batch; the poses then take turns to accept the valid trial
that leaves the smallest error, with what is known updated by the two readings (Sherman–Morrison). Reach grows where
trials succeed and shrinks where they fail.
"""

from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell
from planner.common.determinism import on_one_thread, round_significant
from planner.common.progress import REFINEMENT, must_stop
from planner.common.units import Array
from planner.design.free_parameters import UndeclaredErrors
from planner.design.pose_selection import passes_filters
from planner.runs.run import Samples

ROUNDS, TRIALS = 16, 12
REACH, LONGER, SHORTER = 0.2, 1.2, 0.7  # [rad] of a trial at first, and times that after a success and a failure


@on_one_thread
def refine_bayesian_poses(cell: Cell, unknown: UndeclaredErrors, samples: Samples, seed: int) -> Array:
    """Return poses (n, N) [rad] near those of ``samples``, in their order, that leave a smaller expected error."""
    rng, valid, q = np.random.default_rng(seed), passes_filters(cell, samples), samples.q.copy()
    white, weight, reach = unknown.white(samples), unknown.weight_per_prior, np.full(len(q), REACH)
    for _ in range(ROUNDS):
        if must_stop(REFINEMENT, "the poses were refined off the grid only in part"):
            break
        steps = rng.normal(size=(len(q), TRIALS, q.shape[1])) * rng.random((len(q), TRIALS, 1))
        tried = (q[:, None] + reach[:, None, None] * steps).reshape(-1, q.shape[1])
        of = np.repeat(np.arange(len(q)), TRIALS)
        kept = np.flatnonzero(valid(tried, of))
        tried, of = tried[kept], of[kept]
        taken = _accept(white, unknown.white(replace(samples.take(of), q=tried)), of, weight)
        moved = of[taken]
        q[moved] = tried[taken]
        reach *= SHORTER
        reach[moved] *= LONGER / SHORTER
    return q


def _accept(white: Array, trials: Array, of: np.ndarray, weight: Array) -> np.ndarray:
    """Put into ``white`` (n, P), one pose after the other, the best of its ``trials`` (m, P); return which, (k,).

    With what is known without the pose's own reading, C, a reading a takes a C W C aᵀ / (1 + a C aᵀ) off the mean
    square error (see :mod:`.bayesian_design`).
    """
    covariance: Array = np.asarray(np.linalg.inv(white.T @ white + np.eye(white.shape[1])))
    taken = list[int]()
    for k in range(len(white)):
        mine = np.flatnonzero(of == k)
        covariance = _without(covariance, white[k])
        rows = np.concatenate([white[k : k + 1], trials[mine]])
        seen = rows @ covariance
        gain = np.einsum("ij,ij->i", seen @ weight, seen) / (1.0 + np.einsum("ij,ij->i", seen, rows))
        best = int(np.argmax(round_significant(gain)))
        if best:
            taken.append(int(mine[best - 1]))
            white[k] = rows[best]
        covariance = covariance - np.outer(seen[best], seen[best]) / (1.0 + seen[best] @ rows[best])
    return np.array(taken, dtype=int)


def _without(covariance: Array, row: Array) -> Array:
    seen = covariance @ row
    return np.asarray(covariance + np.outer(seen, seen) / (1.0 - row @ seen))
