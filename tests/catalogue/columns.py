"""Columns that basis functions with a memory need, made from a whole run in plain loops."""

from dataclasses import dataclass

import numpy as np

from planner.run import Samples, speeds


@dataclass(frozen=True)
class Seen(Samples):
    """Samples with the angles of each joint's last reversals (n, N, M) [rad]."""

    reversals: np.ndarray | None = None


def reversals(q, last=8):
    """Angles of each joint's last reversals before every sample, (n, N, last); the start's where there are fewer."""
    n, N = q.shape
    out = np.empty((n, N, last))
    for i in range(N):
        turned, way = [q[0, i]] * last, 0.0
        for k in range(n):
            step = q[k, i] - q[k - 1, i] if k else 0.0
            if step * way < 0:
                turned = [*turned[1:], q[k - 1, i]]
            way = np.sign(step) or way
            out[k, i] = turned
    return out


def seen(samples, readings=None, moving=False):
    """Samples with these columns."""
    return Seen(
        **{
            k: v for k, v in vars(samples).items() if k in Samples.__dataclass_fields__ and k not in ("speed", "length")
        },
        speed=speeds(samples) if moving else samples.speed,
        length=None if readings is None else readings.length,
        reversals=reversals(samples.q),
    )
