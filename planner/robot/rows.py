"""Kinematic rows to elementary transforms: one small function for each convention."""

import numpy as np

from planner.chain import Transform

PARALLEL = np.deg2rad(5.0)  # neighbouring axes closer than this get Hayati's parameter [rad]


def dh_row(i: int, alpha: float, a: float, d: float, theta: float, beta: float | None) -> list[Transform]:
    """Standard DH of row i (from 1): Rz(θ) Tz(d) Tx(a) Rx(α), with Hayati's Ry(β) where given [m, rad]."""
    row = [
        Transform(f"theta{i}", "rotation", 2, theta, i - 1),
        Transform(f"d{i}", "translation", 2, d),
        Transform(f"a{i}", "translation", 0, a),
        Transform(f"alpha{i}", "rotation", 0, alpha),
    ]
    return row if beta is None else [*row, Transform(f"beta{i}", "rotation", 1, beta)]


def mdh_row(i: int, alpha: float, a: float, d: float, theta: float, beta: float | None) -> list[Transform]:
    """Modified DH of row i with Hayati's β: Rx(α) Tx(a) Ry(β) Rz(θ) Tz(d), α, a, β of index i−1 (TriCal, Table 4)."""
    head = [
        Transform(f"alpha{i - 1}", "rotation", 0, alpha),
        Transform(f"a{i - 1}", "translation", 0, a),
    ]
    skew = [] if beta is None else [Transform(f"beta{i - 1}", "rotation", 1, beta)]
    tail = [
        Transform(f"theta{i}", "rotation", 2, theta, i - 1),
        Transform(f"d{i}", "translation", 2, d),
    ]
    return head + skew + tail


def needs_beta(convention: str, i: int, n: int, alpha: float) -> bool:
    """Tell whether row i of n joins near-parallel axes, so that DH alone cannot say that they are skew."""
    joins_axes = i < n if convention == "dh" else i > 1
    return joins_axes and abs(np.sin(alpha)) < np.sin(PARALLEL)


def frame(suffix: str, xyz: np.ndarray, rpy: np.ndarray) -> list[Transform]:
    """A full frame: Tx Ty Tz Rz(yaw) Ry(pitch) Rx(roll), the URDF origin [m, rad]."""
    moves = [Transform(f"{'xyz'[k]}{suffix}", "translation", k, float(xyz[k])) for k in range(3)]
    turns = [Transform(f"r{'xyz'[k]}{suffix}", "rotation", k, float(rpy[k])) for k in (2, 1, 0)]
    return moves + turns
