"""Where plates of sockets stand, and the point that sits in them on the tool: no start needed."""

from dataclasses import dataclass

import numpy as np

from planner.common.units import Array, IntArray, read_only
from planner.gauges.placement.flange_poses import FlangePoses, PlacementFrames, unpack_frames
from planner.gauges.placement.frames import FrameProblem
from planner.gauges.placement.solver import LAST, MANY_ROWS, OPEN_SIGMA, refine
from planner.kinematics.geometry import registration

SURE_OFF = 1e-3  # [m] directions that even such a small error would leave open are not moved at all


@dataclass(frozen=True)
class SocketPlacement:
    """Where the plates P stand: R_BP (S, 3, 3), p_BP (S, 3) [m]; p_FM (T, 3) [m] are the points on the flange."""

    R_BP: Array
    p_BP: Array
    p_FM: Array


def place_sockets(
    stand: FlangePoses, ball: IntArray, p_PS: Array, offset: Array | None = None, p_FM: Array | None = None
) -> SocketPlacement:
    """Find plates and points: R_BF p_FM + p_BF = R_BP (p_PS + offset) + p_BP.

    The points are linear once each socket's mean is taken away; plates follow by registration (Umeyama); then all are
    refined together. What the data leave open gets the least turn and the shortest tool.

    Args:
        stand: flange poses by the nominal robot, with the plate (one place of it each) and the point on the tool.
        ball: which socket the point sits in, (n,) int.
        p_PS: sockets in the plate's own frame, (K, 3) [m].
        offset: of the point from the socket's centre in the plate's axes, (n, 3) [m].
        p_FM: points on the flange where known (then held), (T, 3) [m].
    """
    s = stand
    pair = np.unique(np.stack([s.place, ball], axis=1), axis=0, return_inverse=True)
    keys, of_pair = pair[0], pair[1].reshape(-1)
    m = _tool_points(s, of_pair, p_FM)
    x = s.target_positions(m[None])[0]
    X = np.array([np.median(x[of_pair == k], axis=0) for k in range(len(keys))])
    R, t = _register_plates(s.n_places, keys, X, np.bincount(of_pair).astype(float), p_PS)
    free = np.concatenate([np.full(6 * s.n_places, True), np.full(3 * s.n_points, p_FM is None)])
    problem = FrameProblem(s, p_PS[ball] + (0.0 if offset is None else offset), None, free)
    start = PlacementFrames(R[None], t[None], m[None], np.broadcast_to(np.eye(3), (1, s.n_points, 3, 3)))
    many = problem.take(s.spread(MANY_ROWS))
    found = refine(many, start.pack(), LAST, floor=SURE_OFF / OPEN_SIGMA / np.sqrt(len(many.stand)))
    f = unpack_frames(found.state, s)
    return SocketPlacement(read_only(f.R_BG[0]), read_only(f.p_BG[0]), read_only(f.p_FM[0]))


def _tool_points(s: FlangePoses, of_pair: IntArray, p_FM: Array | None) -> Array:
    """Return the points on the flange (T, 3) [m]: linear once each socket's mean is taken away; least norm."""
    if p_FM is not None:
        return p_FM
    n, T, pairs = len(s), s.n_points, int(of_pair.max()) + 1
    columns = np.zeros((n, 3, 3 * T))
    columns[np.arange(n)[:, None, None], np.arange(3)[:, None], 3 * s.point[:, None, None] + np.arange(3)] = s.R_BF
    weight = np.ones(n)
    for _ in range(12):
        total = np.bincount(of_pair, weight, pairs)[of_pair]
        mean_c, mean_p = np.zeros((pairs, 3, 3 * T)), np.zeros((pairs, 3))
        np.add.at(mean_c, of_pair, columns * (weight / total)[:, None, None])
        np.add.at(mean_p, of_pair, s.p_BF * (weight / total)[:, None])
        C, b = columns - mean_c[of_pair], mean_p[of_pair] - s.p_BF
        H = np.einsum("n,nij,nik->jk", weight, C, C)
        values, V = np.linalg.eigh(H)
        seen = values > (SURE_OFF / OPEN_SIGMA) ** 2
        m = V[:, seen] @ ((V[:, seen].T @ np.einsum("n,nij,ni->j", weight, C, b)) / values[seen])
        r = np.linalg.norm(b - C @ m, axis=1)
        weight = np.minimum(1.0, 1.5 * max(float(np.median(r)), 1e-9) / np.maximum(r, 1e-12))
    return np.asarray(m).reshape(T, 3)


def _register_plates(S: int, keys: IntArray, X: Array, counts: Array, p_PS: Array) -> tuple[Array, Array]:
    """Return R_BP (S, 3, 3) and p_BP (S, 3) of plates by registration; the least turn where it is open."""
    R, t = np.empty((S, 3, 3)), np.empty((S, 3))
    for k in range(S):
        at = keys[:, 0] == k
        R[k], t[k] = registration(X[at], p_PS[keys[at, 1]], counts[at])
    return R, t
