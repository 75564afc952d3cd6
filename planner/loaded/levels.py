"""The steps of load in a run: which pull each sample belongs to."""

import numpy as np

from planner.errors import InputError
from planner.run import Run
from planner.units import Array

BINS = 80  # over the range of the forces
SMALL = 2.0  # [N]: a bar that pulls less is not loaded; kilonewtons look like that
SHARE = 0.01  # of the samples: less than that in a bin is a change from one step to the next


def load_levels(run: Run, on: np.ndarray) -> tuple[Array, np.ndarray]:
    """Return the pull at each step, ascending in size, (K,) [N], and each sample's step (n,) int, −1 between steps.

    Args:
        run: with its pull logged.
        on: which samples lie on a circle, (n,) bool; only they make a step.

    Raises:
        InputError: no pull was logged, there is one step only, or the bar pulls at some and pushes at others.
    """
    force = run.samples.force
    if force is None:
        raise InputError(
            f"{run.name}: the column force_N is missing (pull along the bar, positive towards the fixture); without "
            "the load there is no compliance"
        )
    edges = _edges(np.asarray(force)[on])
    level = np.full(len(force), -1)
    for k, (low, high) in enumerate(edges):
        level[(force >= low) & (force <= high)] = k
    level[~on] = -1
    loads = np.array([float(np.median(force[level == k])) for k in range(len(edges))])
    _check(run, loads)
    order = np.argsort(np.abs(loads), kind="stable")
    rank = np.full(len(order) + 1, -1)
    rank[order] = np.arange(len(order))
    return loads[order], rank[level]


def _edges(force: Array) -> list[tuple[float, float]]:
    """Lower and upper end of each step: runs of well-filled bins."""
    low, high = float(force.min()), float(force.max())
    if high - low < 1.0:
        return [(low, high)]
    count, at = np.histogram(force, BINS, (low, high))
    width = at[1] - at[0]
    full = np.flatnonzero(count > SHARE * len(force))
    groups = np.split(full, 1 + np.flatnonzero(np.diff(full) > 1))
    return [(float(at[g[0]]) - width, float(at[g[-1] + 1]) + width) for g in groups if len(g)]


def _check(run: Run, loads: Array) -> None:
    if len(loads) < 2:
        small = " (are they in kN? the column is in newtons)" if 0 < np.abs(loads).max() < SMALL else ""
        raise InputError(
            f"{run.name}: there is one load only, {loads[0]:.3g} N{small}; a stiffness needs two at least, better the "
            "paper's five (125 to 625 N)"
        )
    if loads.min() < -1.0 and loads.max() > 1.0:
        listed = ", ".join(f"{v:.0f}" for v in np.sort(loads))
        raise InputError(
            f"{run.name}: force_N has both signs ({listed} N): a bar either pulls (positive) or pushes (negative) "
            "throughout; check the sign of each step"
        )
