"""One turn of a circle on an even grid of angles."""

from dataclasses import dataclass

import numpy as np

from planner.errors import InputError
from planner.run import Run
from planner.units import Array


@dataclass(frozen=True)
class Turn:
    """One whole turn: its samples in the order of time, and their angle (m,) [rad]."""

    direction: int
    level: int
    rows: np.ndarray
    theta: Array


def binned(run: Run, turn: Turn, values: Array, bins: int, joints: int) -> Array:
    """Mean of the columns of ``values`` (m, C) at the middle of every bin, (bins, C), straight lines between means.

    A joint (the first ``joints`` columns) that turns once with the circle is averaged relative to the angle.
    """
    width = 2 * np.pi / bins
    around = np.unwrap(turn.theta)
    winding = np.round((values[-1] - values[0]) / (around[-1] - around[0]))
    winding[joints:] = 0.0
    values = values - winding * around[:, None]
    angle = turn.theta % (2 * np.pi)
    where = np.minimum((angle / width).astype(int), bins - 1)
    count = np.bincount(where, minlength=bins)
    if np.any(count == 0):
        gap = float(np.degrees((int(np.flatnonzero(count == 0)[0]) + 0.5) * width))
        raise InputError(f"{run.name}: a turn has no sample about {gap:.0f} degrees; the log has a hole there")
    at = np.bincount(where, angle, bins) / count
    mean = np.stack([np.bincount(where, v, bins) / count for v in values.T], axis=1)
    span = (np.roll(at, -1) - np.roll(at, 1)) % (2 * np.pi)
    slope = (np.roll(mean, -1, axis=0) - np.roll(mean, 1, axis=0)) / span[:, None]
    middle = (np.arange(bins) + 0.5) * width
    return np.asarray(mean + slope * (middle - at)[:, None] + winding * middle[:, None])
