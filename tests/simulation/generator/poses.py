"""Poses: joint samples whose measured point lies where the gauge can hold it, within the joint limits."""

import numpy as np

from tests.simulation.generator.arm import screw

SPAN = np.radians(175.0)  # axes that turn further are sampled within this about zero


def limits(arm):
    """Lower and upper joint limits that poses keep to, (N,) [rad]."""
    return np.maximum(arm.lower, -SPAN), np.minimum(arm.upper, SPAN)


def uniform(arm, count, rng):
    """Joint samples (count, N) [rad], uniform within the limits."""
    lower, upper = limits(arm)
    return lower + (upper - lower) * rng.random((count, arm.n_joints))


def point(arm, q, tool, errors=None):
    """Measured point (n, 3) [m] for a tool point (3,) in the flange frame."""
    R, p = arm.flange(q, errors)
    return p + R @ tool


def point_jacobian(arm, q, tool):
    """Measured point (n, 3) and its derivative by the controller angles (n, 3, N), at nominal geometry."""
    names = [f"theta{i + 1}" for i in range(arm.n_joints)]
    stance = arm.walk(q, {}, names)
    x = stance.p + np.einsum("ijn,j->in", stance.R, tool)
    J = np.stack([screw(arm, stance, name, x) for name in names], axis=2)  # (3, n, N) by theta
    return x.T, np.moveaxis(J, 1, 0) @ arm.sense


def least_norm(J, step):
    """Smallest joint step (n, N) that moves the point by ``step`` (n, 3); damped near singular poses."""
    JJ = J @ J.transpose(0, 2, 1) + 1e-6 * np.eye(3)
    return np.einsum("nij,ni->nj", J, np.linalg.solve(JJ, step[..., None])[..., 0])


def reach(arm, q, target, tool, steps=10):
    """Move the joints from q as little as brings the measured point to ``target`` (n, 3); also what is missing (n,)."""
    for _ in range(steps):
        x, J = point_jacobian(arm, q, tool)
        q = q + np.clip(least_norm(J, target - x), -0.5, 0.5)
    return q, np.linalg.norm(point(arm, q, tool) - target, axis=1)


def at_targets(arm, targets, tool, rng, accept=None, near=0.6, tries=8):
    """One pose (n, N) for each target (n, 3), from random starts, NaN where none was found.

    ``accept(q)`` (m,) bool may refuse some.
    """
    lower, upper = limits(arm)
    found = np.full((len(targets), arm.n_joints), np.nan)
    for _ in range(tries):
        open_ = np.flatnonzero(np.isnan(found[:, 0]))
        if not len(open_):
            return found
        start = uniform(arm, 12_000, rng)
        x = point(arm, start, tool)
        q = np.concatenate([start[_some(x, targets[k], near, rng)] for k in open_])
        rows = np.repeat(open_, len(q) // len(open_))
        q, gap = reach(arm, q, targets[rows], tool)
        good = (gap < 1e-6) & np.all((q > lower) & (q < upper), axis=1)
        good &= accept(q) if accept is not None else True
        found[rows[good][::-1]] = q[good][::-1]
    return found


def _some(x, target, near, rng, count=3):
    """Indices of a few samples within ``near`` of the target, at random; the nearest ones where there are none."""
    close = np.flatnonzero(np.sum((x - target) ** 2, axis=1) < near**2)
    if len(close) < count:
        close = np.argpartition(np.sum((x - target) ** 2, axis=1), count)[:count]
    return rng.choice(close, count, replace=False)


def shell_points(centre, lengths, count, rng, cone):
    """Points (count, 3) between two radii about ``centre``, bar within ``cone`` of the upright."""
    z = 1 - (1 - np.cos(cone)) * rng.random(count)
    turn = 2 * np.pi * rng.random(count)
    flat = np.sqrt(1 - z**2)
    e = np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
    return centre + e * rng.uniform(*lengths, count)[:, None]


def toured(arm, q):
    """Order the poses as a tour would: always on to the nearest one that is left, by the slowest axis."""
    left, order = list(range(1, len(q))), [0]
    while left:
        gaps = np.max(np.abs(q[left] - q[order[-1]]), axis=1)
        order.append(left.pop(int(np.argmin(gaps))))
    return q[order]
