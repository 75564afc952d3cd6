"""Torques with which gravity turns the joints, batched: first moments travel down the chain, gravity up it."""

import numpy as np

from planner.chain import Chain, Transform
from planner.units import Array


def _turned(w: list[Array], axis: int, angle: Array, sign: float) -> list[Array]:
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
            moment = _turned(moment, t.axis, value, 1.0)
    return out


def _gravity_at_joints(
    transforms: tuple[Transform, ...], values: list[Array], gravity_B: Array
) -> dict[int, list[Array]]:
    """Gravity in the frame just after each joint's rotation."""
    g: list[Array] = [np.full(1, float(v)) for v in gravity_B]
    out: dict[int, list[Array]] = {}
    for t, value in zip(transforms, values, strict=True):
        if t.kind == "rotation":
            g = _turned(g, t.axis, value, -1.0)
        if t.joint is not None:
            out[t.joint] = g
    return out
