"""The course of a run: when each sample was taken, from which side, how warm, under what load."""

import numpy as np

from tests.simulation.generator.scene import Scene

PAUSE_S = 900.0  # between sessions
GAP = 2e-4  # [rad] read against commanded angle at rest
SERVO_S = 0.02  # following error of a moving arm in seconds of its speed


def every_pose(q, repeats, rng):
    """Joint angles and pose numbers (from 1) of a run that visits a part ``repeats`` of its poses once more, later."""
    again = np.sort(rng.choice(len(q), round(repeats * len(q)), replace=False))
    order = np.concatenate([np.arange(len(q)), again])
    return q[order], order + 1


def course(arm, bench, gauge, q, truth, rng, active, motion=None):
    """The scene of a run with joint angles q (n, N); ``motion``: times and speeds of a continuous one.

    ``active``: what a static run varies: payload, force, session.
    """
    n, moving = len(q), motion is not None
    t, speed = motion if moving else (np.cumsum(rng.uniform(15.0, 25.0, n)), np.zeros_like(q))
    active = frozenset() if moving else active
    session = np.arange(n) * 4 // n if "session" in active else np.zeros(n, dtype=int)
    t = t + PAUSE_S * session
    gap = SERVO_S * speed if moving else GAP * rng.standard_normal(q.shape)
    steps, payload, force = rng.integers(0, 5, n), np.zeros(n), np.zeros(n)
    if "payload" in active:
        payload = arm.payload * steps / 5
    if "force" in active:
        force = arm.payload * 1.0 * steps
    return Scene(
        arm=arm, gauge=gauge, moving=moving, t=t, q=q, command=q + gap, speed=speed, direction=_side(q, speed, moving),
        session=session, warmth=_warmth(t, rng), payload=payload, force=force,
        fixture=bench.fixture + truth.error("fixture_A"), tool=bench.tool + truth.error("map"),
        tool_mass=bench.tool_kg, tool_com=np.array(bench.com_mm) / 1e3,
        mass=arm.mass * np.array(truth.mass_factor or np.ones(arm.n_joints)),
    )  # fmt: skip


def _side(q, speed, moving):
    """Sign of the last motion of each joint, (n, N): a joint that stands keeps it."""
    way = np.where(np.abs(speed) > 1e-6, speed, 0.0) if moving else np.diff(q, axis=0, prepend=q[:1] - 1e-3)
    sign = np.sign(np.where(np.abs(way) > 1e-9, way, 0.0))
    last = np.maximum.accumulate(np.where(sign != 0, np.arange(len(q))[:, None], 0), axis=0)
    sign = np.take_along_axis(sign, last, axis=0)
    return np.where(sign == 0, 1.0, sign)


def _warmth(t, rng):
    """Temperature above the start, (n,) [K]: the hall warms up by some degrees and sways."""
    t = t - t[0]
    rise = rng.uniform(3.0, 8.0) * (1 - np.exp(-t / rng.uniform(2000.0, 4000.0)))
    return rise + rng.uniform(0.2, 0.8) * np.sin(2 * np.pi * t / rng.uniform(900.0, 1800.0))
