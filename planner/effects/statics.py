"""Static loads on the robot: torques of gravity about the joints, and moments of loads about frames along the arm."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from planner.common.units import Array
from planner.kinematics.chain import Chain, Transform


@dataclass(frozen=True)
class StationFrames:
    """Some frames of the chain in the base frame: orientations R (S, 3, 3, n) and origins p (S, 3, n) [m]."""

    R: Array
    p: Array


@dataclass(frozen=True)
class HangingLoad:
    """A weight: it hangs on the frame after the first ``end`` transforms; mass [kg], centre p_B (3, n) [m]."""

    end: int
    mass: Array | float
    centre: Array


def station_frames(chain: Chain, theta: Array, ends: Sequence[int]) -> StationFrames:
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
    return StationFrames(R_all, p_all)


def load_moments(
    at: StationFrames,
    ends: Sequence[int],
    loads: Sequence[HangingLoad],
    gravity_B: Array,
    pull: tuple[Array, Array] | None,
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


def _rotate(w: list[Array], axis: int, angle: Array, sign: float) -> list[Array]:
    """Rotate the vector w (three arrays) about ``axis`` by ``sign``·angle."""
    b, c = (axis + 1) % 3, (axis + 2) % 3
    cos, sin = np.cos(angle), sign * np.sin(angle)
    out = list(w)
    out[b], out[c] = cos * w[b] - sin * w[c], sin * w[b] + cos * w[c]
    return out


def gravity_torque(
    chain: Chain, theta: Array, gravity_B: Array, loads: tuple[tuple[int, Array | float, Array], ...]
) -> Array:
    """Return the torque of gravity about each joint's axis, (n, N) [Nm], in the sense of the kinematic rows.

    It is minus the static torque that Newton–Euler gives the motors (virtual work).

    Args:
        chain: base to flange.
        theta: angles of the kinematic rows, (n, N) [rad].
        gravity_B: acceleration of gravity in the base frame, (3,) [m/s²].
        loads: (end, mass, com): masses [kg], one number or (n,), with centres of mass (3,) [m] in the frame that
            stands after the first ``end`` transforms.
    """
    values = chain.values(theta)
    gravity = _gravity_at_joints(chain.transforms, values, gravity_B)
    out = np.zeros_like(theta)
    mass: Array = np.zeros(1)
    moment = [np.zeros(1), np.zeros(1), np.zeros(1)]
    for k in range(len(chain.transforms), -1, -1):
        for end, m, com in loads:
            if end == k:
                mass = mass + np.atleast_1d(m)
                moment = [w + m * float(c) for w, c in zip(moment, com, strict=True)]
        if k == 0:
            break
        t, value = chain.transforms[k - 1], values[k - 1]
        if t.joint is not None:
            g, b, c = gravity[t.joint], (t.axis + 1) % 3, (t.axis + 2) % 3
            out[:, t.joint] += moment[b] * g[c] - moment[c] * g[b]
        if t.kind == "translation":
            moment[t.axis] = moment[t.axis] + mass * value
        else:
            moment = _rotate(moment, t.axis, value, 1.0)
    return out


def _gravity_at_joints(
    transforms: tuple[Transform, ...], values: list[Array], gravity_B: Array
) -> dict[int, list[Array]]:
    """Gravity in the frame just after each joint's rotation."""
    g: list[Array] = [np.full(1, float(v)) for v in gravity_B]
    out: dict[int, list[Array]] = {}
    for t, value in zip(transforms, values, strict=True):
        if t.kind == "rotation":
            g = _rotate(g, t.axis, value, -1.0)
        if t.joint is not None:
            out[t.joint] = g
    return out
