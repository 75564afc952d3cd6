"""Poses that no path joins to the rest are replaced by the candidates that keep the index best, and told."""

from collections.abc import Callable

import numpy as np

from planner.common.errors import NoSolutionError
from planner.design.candidates.pool import PoseSet
from planner.design.observability.information import find_rule
from planner.design.pose_selection import PoseChoice

TRIED = 3000  # candidates that compete for one place
ROUNDS = 8


def replace_all(
    pool: PoseSet, choice: PoseChoice, find_lost: Callable[[PoseChoice], np.ndarray], advice: str
) -> tuple[PoseChoice, int]:
    """Replace lost poses until none is lost; returned beside the choice: how many were.

    Args:
        pool: the candidates.
        choice: the chosen poses.
        find_lost: gives the positions of the chosen poses that are to be replaced.
        advice: what was tried in vain, and what would help.

    Raises:
        NoSolutionError: replacements are lost again and again.
    """
    count = 0
    for _ in range(ROUNDS):
        lost = find_lost(choice)
        if not len(lost):
            return choice, count
        for k in lost:
            choice = replace_pose(pool, choice, int(k))
        count += len(lost)
    raise NoSolutionError(f"{count} chosen poses {advice}")


def replace_pose(pool: PoseSet, choice: PoseChoice, lost: int) -> PoseChoice:
    """Put the candidate that keeps the index best, of those on the same fixture, in the place of a lost pose."""
    rng = np.random.default_rng(lost)
    there = choice.samples
    alike = pool.samples.held(there.mounting(lost))
    if pool.ball is not None:
        alike &= pool.ball == pool.ball[choice.chosen[lost]]
    others = np.setdiff1d(np.flatnonzero(alike), choice.chosen)
    tried = np.sort(rng.choice(others, min(TRIED, len(others)), replace=False))
    kept = choice.model.rows(there.take(np.arange(len(there)) != lost))
    kept = kept.reshape(-1, kept.shape[2])
    rows = choice.model.rows(pool.samples.take(tried))
    mass = kept.T @ kept + np.swapaxes(rows, 1, 2) @ rows
    mu = np.sqrt(np.maximum(np.linalg.eigvalsh(mass)[:, ::-1], 0.0))
    wanted = find_rule(choice.index)
    value = wanted.of(mu, len(choice.q)) * (1.0 if wanted.maximise else -1.0)
    best = int(tried[np.argmax(value)])
    q, chosen = choice.q.copy(), choice.chosen.copy()
    q[lost], chosen[lost] = pool.q[best], best
    return choice.with_poses(q, chosen, pool)
