"""Which samples are held out together: whole poses, placements, sessions, or stretches of a continuous run."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from planner.run import Run
from planner.units import Array

SAME = np.deg2rad(0.01)  # joint angles closer than this are the same pose measured again
STRETCHES = 8  # stretches for each fold of a continuous run: every fold sees every part of it
FEWEST = 5  # placements or sessions that make a split of their own: held out, a fold of fewer is too large a part
SEVERAL = 3  # placements or sessions from which on neighbours in the run's order are held out together
SMALL = 0.03  # share of the samples that a session must hold to count


@dataclass(frozen=True)
class Split:
    """Groups that are never torn apart, dealt into folds.

    Attributes:
        by: ``pose``, ``placement``, ``session``, ``block`` (of a static run in its order) or ``stretch``.
        group: of every sample, (n,) int.
        fold: of every sample, (n,) int from 0.
        fine: poses with their repeats, or stretches: what scatters for itself, (n,) int.
    """

    by: str
    group: np.ndarray
    fold: np.ndarray
    fine: np.ndarray

    @property
    def folds(self) -> int:
        """Number of folds."""
        return int(self.fold.max()) + 1

    @property
    def groups(self) -> int:
        """Number of groups."""
        return len(np.unique(self.group))

    def take(self, which: np.ndarray) -> "Split":
        """Return the split of the samples at ``which``, the folds as they are."""
        return Split(self.by, self.group[which], self.fold[which], self.fine[which])


def split(run: Run, hold_out: float = 0.2, seed: int = 0) -> Split:
    """Deal a run into folds of about ``hold_out`` of its groups each."""
    by, group = groups(run)
    labels, group = np.unique(group, return_inverse=True)
    group = group.reshape(-1)
    folds = min(len(labels), max(2, round(1 / hold_out)))
    if by in ("stretch", "block"):
        deal = np.arange(len(labels)) % folds
    else:
        order = np.random.default_rng(seed).permutation(len(labels))
        deal = np.empty(len(labels), dtype=int)
        deal[order] = np.arange(len(labels)) % folds
    fine = np.unique(fine_groups(run), return_inverse=True)[1].reshape(-1)
    return Split(by, group, deal[group], fine)


def within(run: Run, whole: Split) -> Split | None:
    """Return the finer split beside one by sessions, placements or blocks: single poses; ``None`` where it is as fine.

    What comes anew with each session or placement cannot be predicted where that is held out whole; here it can.
    """
    if whole.by not in ("session", "placement", "block"):
        return None
    labels, group = np.unique(whole.fine, return_inverse=True)
    deal = np.random.default_rng(0).permutation(len(labels)) % whole.folds
    return Split("pose", whole.fine, deal[group.reshape(-1)], whole.fine)


def groups(run: Run) -> tuple[str, np.ndarray]:
    """Return what the groups are and the group of every sample, (n,).

    Whole placements and whole sessions where there are enough of them. Of three whole ones each fold would lose a
    third of the run, and all that was measured about one fixture: then it is blocks of the run in its order, every fold
    with its share of each.
    """
    samples = run.samples
    stood = samples.place if run.readings.length is None else np.zeros(len(run), dtype=int)
    if len(np.unique(stood)) >= FEWEST:
        return "placement", stood
    if run.continuous:
        return "stretch", _stretches(len(run))
    session = np.zeros(len(run), dtype=int) if samples.session is None else samples.session
    if _balanced(session):
        return "session", session
    whole = fine_groups(run)
    if max(len(np.unique(session)), len(np.unique(stood))) >= SEVERAL:
        block = together(_stretches(len(run)), whole)
        if len(np.unique(block)) >= 2 * FEWEST:  # poses measured again and again would chain them all
            return "block", block
    return "pose", whole


def fine_groups(run: Run) -> np.ndarray:
    """The finest groups that are never torn apart, (n,): poses with their repeats, or stretches."""
    return _stretches(len(run)) if run.continuous else together(poses(run.samples.q), run.samples.pose)


def _stretches(n: int) -> np.ndarray:
    return np.arange(n) * (STRETCHES * 5) // max(1, n)


def _balanced(session: np.ndarray) -> bool:
    """Tell whether sessions are fit to be held out: enough of them hold a fair part, and none holds most."""
    share = np.unique(session, return_counts=True)[1] / len(session)
    return bool((share > SMALL).sum() >= FEWEST and share.max() <= 0.5)


def poses(q: Array) -> np.ndarray:
    """Number the poses (n, N) [rad] so that a pose measured again has the number of the first time, (n,)."""
    return np.unique(np.round(q / SAME).astype(np.int64), axis=0, return_inverse=True)[1].reshape(-1)


def together(a: np.ndarray, b: np.ndarray | None) -> np.ndarray:
    """Join the groups a (n,) that share a group of b (n,), negative numbers of b standing for none, (n,)."""
    if b is None:
        return a
    known = b >= 0
    b = np.unique(b, return_inverse=True)[1].reshape(-1)
    edges = coo_array((np.ones(known.sum()), (a[known], a.max() + 1 + b[known])), shape=(a.max() + b.max() + 2,) * 2)
    return np.asarray(connected_components(edges, directed=False)[1][a])
