"""Frames along the robot, and the moments with which loads bend it there, batched over samples."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from planner.chain import Chain
from planner.units import Array


@dataclass(frozen=True)
class Frames:
    """Some frames of the chain in the base frame: orientations R (S, 3, 3, n) and origins p (S, 3, n) [m]."""

    R: Array
    p: Array


@dataclass(frozen=True)
class Load:
    """A weight: it hangs on the frame after the first ``end`` transforms; mass [kg], centre p_B (3, n) [m]."""

    end: int
    mass: Array | float
    centre: Array


def frames(chain: Chain, theta: Array, ends: Sequence[int]) -> Frames:
    """Return the frames that stand after the first ``ends`` transforms (rising) of a chain; theta (n, N) [rad]."""
    n = len(theta)
    R, p = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, n)), np.zeros((3, n))
    R_all, p_all = np.empty((len(ends), 3, 3, n)), np.empty((len(ends), 3, n))
    for s, (start, end) in enumerate(pairwise((0, *ends))):
        if end > start:
            part = Chain(chain.transforms[start:end]).forward(theta)
            p = p + np.einsum("ijn,jn->in", R, part.x)
            R = np.einsum("ijn,jkn->ikn", R, part.R)
        R_all[s], p_all[s] = R, p
    return Frames(R_all, p_all)


def moments(
    at: Frames, ends: Sequence[int], loads: Sequence[Load], gravity_B: Array, pull: tuple[Array, Array] | None
) -> Array:
    """Return the moments (S, 3, n) [Nm] about the axes of frames, of the weights that hang at or beyond each frame.

    Args:
        at: the frames.
        ends: number of transforms before each frame.
        loads: the weights.
        gravity_B: acceleration of gravity in the base frame, (3,) [m/s²].
        pull: point and force (3, n) [m, N] of a force that acts beyond all frames.
    """
    out = np.zeros(at.p.shape)
    g = np.broadcast_to(gravity_B[:, None], at.p.shape[1:])
    for s, end in enumerate(ends):
        moment = np.zeros(at.p.shape[1:])
        for load in loads:
            if load.end >= end:
                moment = moment + load.mass * np.cross(load.centre - at.p[s], g, axis=0)
        if pull is not None:
            moment = moment + np.cross(pull[0] - at.p[s], pull[1], axis=0)
        out[s] = np.einsum("ijn,in->jn", at.R[s], moment)
    return out
