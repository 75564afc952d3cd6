"""Where each joint last turned round: what friction remembers."""

import numpy as np

from planner.units import Array

STEP = 1e-4  # [rad] of travel that tells a reversal from the noise of the encoder


def reversals(q: Array, last: int = 4) -> Array:
    """Angles at each joint's last reversals before every sample, the latest last.

    Args:
        q: angles along a driven path, (n, N) [rad].
        last: how many, M; where there were fewer the path's first angle stands.

    Returns:
        (n, N, M) [rad].
    """
    n, joints = q.shape
    out = np.empty((n, joints, last))
    for i in range(joints):
        out[:, i] = q[_turns(q[:, i], n, last), i]
    return out


def _turns(angle: Array, n: int, last: int) -> np.ndarray:
    """Sample of each of the last reversals before every sample, (n, last)."""
    level = np.round(angle / STEP)
    moved = np.flatnonzero(np.diff(level)) + 1  # samples that stand on another step than the one before
    way = np.sign(level[moved] - level[moved - 1])
    back = np.flatnonzero(way[1:] != way[:-1]) + 1
    seen, turned = moved[back], moved[back] - 1  # when a reversal shows, and where it was
    turned = np.concatenate([np.zeros(last, dtype=int), turned])
    count = np.searchsorted(seen, np.arange(n), side="right")
    return np.asarray(turned[count[:, None] + np.arange(last)])
