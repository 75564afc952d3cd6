"""Which samples are held out together: whole poses, placements, sessions, or stretches of a continuous run."""

from dataclasses import dataclass

import numpy as np

from planner.run import Run
from planner.units import Array

SAME = np.deg2rad(0.01)  # joint angles closer than this are the same pose measured again
STRETCHES = 8  # stretches for each fold of a continuous run: every fold sees every part of it
FEWEST = 3  # placements or sessions that make a split of their own


@dataclass(frozen=True)
class Split:
    """Groups that are never torn apart, dealt into folds.

    Attributes:
        by: ``pose``, ``placement``, ``session`` or ``stretch``.
        group: of every sample, (n,) int.
        fold: of every sample, (n,) int from 0.
    """

    by: str
    group: np.ndarray
    fold: np.ndarray

    @property
    def folds(self) -> int:
        """Number of folds."""
        return int(self.fold.max()) + 1

    @property
    def groups(self) -> int:
        """Number of groups."""
        return len(np.unique(self.group))


def split(run: Run, hold_out: float = 0.2, seed: int = 0) -> Split:
    """Deal a run into folds of about ``hold_out`` of its groups each."""
    by, group = groups(run)
    labels, group = np.unique(group, return_inverse=True)
    folds = min(len(labels), max(2, round(1 / hold_out)))
    if by == "stretch":
        deal = np.arange(len(labels)) % folds
    else:
        order = np.random.default_rng(seed).permutation(len(labels))
        deal = np.empty(len(labels), dtype=int)
        deal[order] = np.arange(len(labels)) % folds
    return Split(by, group, deal[group])


def groups(run: Run) -> tuple[str, np.ndarray]:
    """Return what the groups are and the group of every sample, (n,)."""
    samples = run.samples
    if run.readings.length is None and len(run.places) >= FEWEST:
        return "placement", samples.place
    if run.continuous:
        count = STRETCHES * 5
        return "stretch", np.arange(len(run)) * count // max(1, len(run))
    if samples.session is not None and len(np.unique(samples.session)) >= FEWEST:
        return "session", samples.session
    return "pose", samples.pose if samples.pose is not None else poses(samples.q)


def poses(q: Array) -> np.ndarray:
    """Number the poses (n, N) [rad] so that a pose measured again has the number of the first time, (n,)."""
    return np.unique(np.round(q / SAME).astype(np.int64), axis=0, return_inverse=True)[1].reshape(-1)
