"""How far tool and bar can get while the joints move within a small neighbourhood of a state.

A neighbourhood is a state q and spokes δ_1 … δ_M: the convex hull of the q + δ_m (for a motion, M = 1, of q ± δ).
From q to any of its points the arm goes straight, q + t δ. A point x of the arm then moves by at most

    |J δ| + ½ Σ_ij |δ_i| |δ_j| r_max(i,j),      r_j the largest distance of x from axis j,

as ∂²x/∂θ_i∂θ_j = u_i × (u_j × (x − p_j)) for i ≤ j (Taylor with the remainder bounded over all states). |J δ| is
convex in δ, so the spokes bound it for the whole hull.
"""

from dataclasses import dataclass

import numpy as np

from planner.path.kinematics import Pose
from planner.units import Array

FAR = np.inf


@dataclass(frozen=True)
class Travel:
    """Bounds over n neighbourhoods.

    Attributes:
        step: largest |Δθ| of each joint, (n, N) [rad].
        move: path length of the MAP from the centre to any point, (n,) [m].
        stretch: change of the bar's length, (n,) [m].
        swing: path length of the bar's direction, (n,) [rad].
        turn: of the tool, (n,) [rad].
    """

    step: Array
    move: Array
    stretch: Array
    swing: Array
    turn: Array


def travel(pose: Pose, spokes: Array, reach: Array) -> Travel:
    """Bound the travel of tool and bar over neighbourhoods.

    Args:
        pose: tool and bar at the n centres.
        spokes: Δθ of each spoke, (n, M, N) [rad].
        reach: largest distance of the MAP from each axis, (N,) [m].
    """
    step = np.abs(spokes).max(axis=1)
    velocity = np.einsum("nij,nmj->nmi", pose.J, spokes)
    bend = curvature(step, reach)
    speed = np.linalg.norm(velocity, axis=2).max(axis=1)
    move = speed + bend / 2
    along = np.abs(np.einsum("nmi,ni->nm", velocity, pose.direction)).max(axis=1)
    left = pose.length - move  # shortest length in the neighbourhood
    safe = np.maximum(left, 1e-9)
    stretch = np.minimum(move, along + ((speed + bend) ** 2 / safe + bend) / 2)
    swing = np.where(left > 0, move / safe, FAR)
    spinning = np.linalg.norm(np.einsum("nij,nmj->nmi", pose.W, spokes), axis=2).max(axis=1)
    earlier = np.cumsum(step, axis=1) - step
    turn = spinning + np.einsum("nj,nj->n", step, earlier) / 2
    return Travel(step, move, stretch, swing, turn)


def curvature(step: Array, reach: Array) -> Array:
    """Return Σ_ij step_i step_j reach_max(i,j), (n,) [m], for steps (n, N) [rad] and reaches (N,) [m]."""
    joint = np.arange(len(reach))
    return np.asarray(np.einsum("ni,nj,ij->n", step, step, reach[np.maximum.outer(joint, joint)], optimize=True))
