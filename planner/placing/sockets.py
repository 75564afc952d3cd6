"""Where plates of sockets (or balls) stand and where the point that sits in them is on the tool: no start needed."""

from dataclasses import dataclass

import numpy as np

from planner.errors import InputError
from planner.placing.frame_problem import FrameProblem, Frames, unpacked
from planner.placing.frames import LAST, MANY, judged, unknowns
from planner.placing.inputs import IntArray, Stand, rows, stand
from planner.placing.open import LIMIT, left_open
from planner.placing.plate import Distance, fitted_shape
from planner.placing.rotations import registration
from planner.placing.solver import refine
from planner.units import Array, frozen

_SURE = 1e-3  # [m] directions that even such a small error would leave open are not moved at all


@dataclass(frozen=True)
class SocketPlacing:
    """Where the plates P stand.

    Attributes:
        R_BP, p_BP: plates in the base frame, (S, 3, 3) and (S, 3) [m].
        p_FM: points on the flange, (T, 3) [m].
        p_PS: sockets in the plate's frame, (K, 3) [m], as given or as found with the known distances.
        rms: of the distances to the sockets that are not outliers [m].
        outlier: distances beyond about 5.6 robust standard deviations, (n,) bool.
        undetermined: what the data leave open, in words; there the least turn and the shortest tool are taken.
    """

    R_BP: Array
    p_BP: Array
    p_FM: Array
    p_PS: Array
    rms: float
    outlier: np.ndarray
    undetermined: tuple[str, ...]


def place_sockets(
    p_BF: Array,
    R_BF: Array,
    ball: IntArray,
    place: IntArray,
    point: IntArray,
    p_PS: Array | None = None,
    distances: tuple[Distance, ...] = (),
    offset: Array | None = None,
    p_FM: Array | None = None,
) -> SocketPlacing:
    """Find plates and points: R_BF p_FM + p_BF = R_BP (p_PS + offset) + p_BP.

    The points are linear once each socket's mean is taken away; plates follow by registration (Umeyama); then all are
    refined together with the distances between the sockets held.

    Args:
        p_BF, R_BF: flange poses by the nominal robot, (n, 3) [m], (n, 3, 3).
        ball: which socket the point sits in, (n,) int.
        place, point: which plate (one place of it each), which point on the tool, (n,) int.
        p_PS: sockets in the plate's own frame, (K, 3) [m]; or ``None`` with
        distances: (socket, socket, distance [m]) known between them.
        offset: of the point from the socket's centre in the plate's axes, (n, 3) [m].
        p_FM: points on the flange where known (then held), (T, 3) [m].

    Raises:
        InputError: shapes, numbers or indices are wrong, or neither positions nor distances are given.
    """
    s = stand(p_BF, R_BF, place, point, points=0 if p_FM is None else len(p_FM))
    ball = _balls(ball, len(s), p_PS, distances)
    away = np.zeros((len(s), 3)) if offset is None else np.asarray(offset, dtype=float)
    rows((("offset", away, (len(s), 3)),))
    pair = np.unique(np.stack([s.place, ball], axis=1), axis=0, return_inverse=True)
    keys, of_pair = pair[0], pair[1].reshape(-1)
    m = _points(s, of_pair, p_FM)
    X, counts = _means(s.carried(m[None])[0], of_pair, len(keys))
    if p_PS is None:
        p_PS = fitted_shape(keys, X, counts, distances)
    R, t = _plates(s.n_places, keys, X, counts, p_PS)
    free = np.concatenate([np.full(6 * s.n_places, True), np.full(3 * s.n_points, p_FM is None)])
    problem = FrameProblem(s, p_PS[ball] + away, None, free)
    start = Frames(R[None], t[None], m[None], np.broadcast_to(np.eye(3), (1, s.n_points, 3, 3)))
    many = problem.take(s.spread(MANY))
    found = refine(many, start.packed(), LAST, floor=_SURE / LIMIT / np.sqrt(len(many.stand)))
    f = unpacked(found.state, s)
    error, outlier = judged(problem, found.state)
    missing = left_open(found.jacobian[0], found.error[0], unknowns(s, free))
    rms = float(np.sqrt((error[~outlier] ** 2).mean()))
    names = tuple(str(u).replace("gauge frame", "plate") for u in missing)
    R_BP, p_BP, tool, plate = (frozen(v) for v in (f.R_BG[0], f.p_BG[0], f.p_FM[0], p_PS))
    return SocketPlacing(R_BP, p_BP, tool, plate, rms, outlier, names)


def _balls(ball: IntArray, n: int, p_PS: Array | None, distances: tuple[Distance, ...]) -> IntArray:
    """Check the sockets' indices against what is known of them."""
    rows((("ball", ball, (n,)),))
    ball = np.asarray(ball, dtype=np.int64)
    if ball.min() < 0:
        raise InputError(f"ball holds the index {ball.min()}; indices count from 0")
    if p_PS is not None:
        rows((("p_PS", p_PS, (len(p_PS), 3)),))
        if ball.max() >= len(p_PS):
            raise InputError(f"ball holds the index {ball.max()}, but the positions of only {len(p_PS)} are given")
    elif ball.max() > 0 and not distances:
        raise InputError("the run has several sockets, but neither their positions nor their distances are given")
    return ball


def _points(s: Stand, of_pair: IntArray, p_FM: Array | None) -> Array:
    """Return the points on the flange (T, 3) [m]: linear once each socket's mean is taken away; least norm."""
    if p_FM is not None:
        return np.asarray(p_FM, dtype=float)
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
        seen = values > (_SURE / LIMIT) ** 2
        m = V[:, seen] @ ((V[:, seen].T @ np.einsum("n,nij,ni->j", weight, C, b)) / values[seen])
        r = np.linalg.norm(b - C @ m, axis=1)
        weight = np.minimum(1.0, 1.5 * max(float(np.median(r)), 1e-9) / np.maximum(r, 1e-12))
    return np.asarray(m).reshape(T, 3)


def _means(x: Array, of_pair: IntArray, pairs: int) -> tuple[Array, Array]:
    """Return the middle (median) of each pair's points (pairs, 3) [m], and how many there are (pairs,)."""
    X = np.array([np.median(x[of_pair == k], axis=0) for k in range(pairs)])
    return X, np.bincount(of_pair, minlength=pairs).astype(float)


def _plates(S: int, keys: IntArray, X: Array, counts: Array, p_PS: Array) -> tuple[Array, Array]:
    """Return R_BP (S, 3, 3) and p_BP (S, 3) of plates by registration; the least turn where it is open."""
    R, t = np.empty((S, 3, 3)), np.empty((S, 3))
    for k in range(S):
        at = keys[:, 0] == k
        R[k], t[k] = registration(X[at], p_PS[keys[at, 1]], counts[at])
    return R, t
