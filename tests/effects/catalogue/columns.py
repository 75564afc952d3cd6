"""Columns that basis functions with a memory need, made from a whole run in plain loops."""

from dataclasses import replace

import numpy as np

from planner.runs.joint_motion import joint_speeds


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
    return replace(
        samples,
        speed=joint_speeds(samples) if moving else samples.speed,
        length=None if readings is None else readings.length,
        reversals=reversals(samples.q),
    )
