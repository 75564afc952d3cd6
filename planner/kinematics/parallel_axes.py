"""Rows of near-parallel axes whose offsets run far out and back, written by Hayati's parameter instead.

Where two axes are nearly parallel, their common normal lies anywhere, and a calibration by plain DH rows puts it
hundreds of metres out: a UR's own rows have d of +384 m and -391 m. The frame of a joint may slide along and turn about
its own axis without a change of the chain. So each such frame is brought to where its axis crosses the plane that is
normal to the axis before (d = 0), and the row gets Hayati's β: the chain is the same to rounding.

Source: Hayati, Robot arm geometric link parameter estimation, IEEE CDC 1983.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from planner.kinematics.chain import is_near_parallel

Row = Mapping[str, float]


def shorten_offsets(convention: str, rows: Sequence[Row]) -> list[dict[str, float]]:
    """Return DH or MDH rows [m, rad] of which none has an offset far out that another one takes back.

    Rows without such offsets are returned as they are.

    Args:
        convention: ``dh`` or ``mdh``.
        rows: ``alpha``, ``a``, ``theta``, ``d``, and ``beta`` where it is given, from base to flange.
    """
    far_out = 1.0  # [m] by which offsets along parallel axes go out and come back; those of arms are below half a metre
    n, out = len(rows), [dict(row) for row in rows]
    ahead = int(convention == "mdh")  # the row that holds a, α and β behind axis i
    parallel = [
        i + ahead < n and is_near_parallel(convention, i + 1 + ahead, n, out[i + ahead]["alpha"]) for i in range(n)
    ]
    i = 0
    while i < n:
        end = i
        while end < n and parallel[end]:
            end += 1
        offsets = [row["d"] for row in out[i : end + 1]]
        if end > i and sum(map(abs, offsets)) - abs(sum(offsets)) > far_out:
            for k in range(i, end):
                _to_crossing(out[k], out[k + ahead], out[k + 1])
        i = end + 1
    return out


def _to_crossing(joint: dict[str, float], link: dict[str, float], after: dict[str, float]) -> None:
    """Bring the frame behind a joint to where the next axis crosses the plane normal to this one.

    Args:
        joint: the row with θ and d of the joint; ``link``: with a, α and β behind it (of DH the same row).
        after: the row with θ and d of the next joint, which takes up the slide and the turn along its axis.
    """
    R = _turn("z", joint["theta"]) @ _turn("x", link["alpha"]) @ _turn("y", link.get("beta", 0.0))
    p = _turn("z", joint["theta"]) @ np.array([link["a"], 0.0, joint["d"]])
    slide = float(-p[2] / R[2, 2])
    crossing = p + slide * R[:, 2]
    theta = float(np.arctan(crossing[1] / crossing[0])) if crossing[0] else float(np.copysign(np.pi / 2, crossing[1]))
    a = float(crossing[0] * np.cos(theta) + crossing[1] * np.sin(theta))
    R = _turn("z", -theta) @ R
    beta, alpha = float(np.arcsin(R[0, 2])), float(np.arctan2(-R[1, 2], R[2, 2]))
    turned = R.T @ _turn("x", alpha) @ _turn("y", beta)  # about z alone
    turn = float(np.arctan2(turned[1, 0], turned[0, 0]))
    joint |= {"theta": theta, "d": 0.0}
    link |= {"a": a, "alpha": alpha, "beta": beta}
    after["theta"] = _within_half_turn(after["theta"] - turn)
    after["d"] -= slide


def _within_half_turn(angle: float) -> float:
    return float(np.arctan2(np.sin(angle), np.cos(angle))) if abs(angle) > np.pi else angle


def _turn(axis: str, angle: float) -> np.ndarray:
    out, k = np.eye(3), "xyz".index(axis)
    b, c = (k + 1) % 3, (k + 2) % 3
    out[b, b], out[b, c], out[c, b], out[c, c] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
    return out
