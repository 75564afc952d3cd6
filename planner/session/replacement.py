"""Poses that no path joins to the rest are replaced by the candidates that keep the index best, and told."""

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import NoSolutionError
from planner.design.candidates.pool import PoseSet
from planner.design.observability.information import find_rule
from planner.design.pose_selection import PoseChoice
from planner.motion.path.constraints import Constraints
from planner.motion.path.roadmap import connected_parts

TRIED = 3000  # candidates that compete for one place
ROUNDS = 8


def replace_unjoined(cell: Cell, pool: PoseSet, choice: PoseChoice, seed: int) -> tuple[PoseChoice, tuple[str, ...]]:
    """Replace the chosen candidates that lie in another part of the shell than their fixture's mount pose.

    Raises:
        NoSolutionError: replacements land in other parts again and again.
    """
    count = 0
    for _ in range(ROUNDS):
        lost = _unjoined_poses(cell, pool, choice, seed)
        if not len(lost):
            note = f"{count} chosen poses that no path joins to the mount pose were replaced"
            return choice, (note,) if count else ()
        for k in lost:
            choice = replace_pose(pool, choice, int(k))
        count += len(lost)
    raise NoSolutionError(
        f"{count} chosen poses could not be joined to the mount pose, nor those put in their places: the cable or an "
        "obstacle splits the shell into many parts; widen cable limits or choose another gauge.mount_deg"
    )


def _unjoined_poses(cell: Cell, pool: PoseSet, choice: PoseChoice, seed: int) -> np.ndarray:
    """Positions of the chosen poses that are not in the part of their fixture's mount pose."""
    lost = []
    for k, fixture in enumerate(cell.fixtures):
        mine = np.flatnonzero(choice.fixture == k)
        states = np.vstack([np.array(fixture.mount), choice.q[mine], pool.q[pool.fixture == k]])
        part = connected_parts(Constraints(cell, k), states, seed, certain=1 + len(mine))
        lost.append(mine[part[1 : 1 + len(mine)] != part[0]])
    return np.concatenate(lost)


def replace_pose(pool: PoseSet, choice: PoseChoice, lost: int) -> PoseChoice:
    """Put the candidate that keeps the index best, of those on the same fixture, in the place of a lost pose."""
    rng = np.random.default_rng(lost)
    alike = pool.fixture == choice.fixture[lost]
    if pool.ball is not None:
        alike &= pool.ball == pool.ball[choice.chosen[lost]]
    others = np.setdiff1d(np.flatnonzero(alike), choice.chosen)
    tried = np.sort(rng.choice(others, min(TRIED, len(others)), replace=False))
    kept = choice.model.jacobian(np.delete(choice.q, lost, axis=0), np.delete(choice.fixture, lost))
    kept = kept.reshape(-1, kept.shape[2])
    rows = choice.model.jacobian(pool.q[tried], pool.fixture[tried])
    mass = kept.T @ kept + np.swapaxes(rows, 1, 2) @ rows
    mu = np.sqrt(np.maximum(np.linalg.eigvalsh(mass)[:, ::-1], 0.0))
    wanted = find_rule(choice.index)
    value = wanted.of(mu, len(choice.q)) * (1.0 if wanted.maximise else -1.0)
    best = int(tried[np.argmax(value)])
    q, chosen = choice.q.copy(), choice.chosen.copy()
    q[lost], chosen[lost] = pool.q[best], best
    return choice.with_poses(q, chosen, pool)
