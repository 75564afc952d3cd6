"""Where plates of sockets stand, their shape, and the point that sits in them on the tool: no start needed."""

from dataclasses import dataclass

import numpy as np

from planner.common.errors import InputError, NoSolutionError
from planner.common.units import Array, read_only
from planner.gauges.placement.flange_poses import (
    FlangePoses,
    IntArray,
    PlacementFrames,
    check_arrays,
    flange_poses,
    unpack_frames,
)
from planner.gauges.placement.frames import LAST, MANY, FrameProblem, find_outliers, frame_unknowns
from planner.gauges.placement.rotations import registration
from planner.gauges.placement.solver import LIMIT, refine, undetermined_unknowns

SocketDistance = tuple[int, int, float]  # socket, socket, distance between them [m]


def fit_plate_shape(keys: IntArray, X: Array, counts: Array, distances: tuple[SocketDistance, ...]) -> Array:
    """Return the sockets in the plate's frame p_PS (K, 3) [m]: the seen shape, the known distances held.

    The first socket is the origin, the second lies on +x, the third in the xy-plane.

    Args:
        keys: (place, socket) of each seen pair, (q, 2) int.
        X: where it was seen in the base frame, (q, 3) [m].
        counts: how often, (q,).
        distances: the distances that are known.

    Raises:
        InputError: a distance is not positive, or names a socket that was never seen.
        NoSolutionError: the plates that were seen share too few sockets to be put together.
    """
    K = int(keys[:, 1].max()) + 1
    for a, b, length in distances:
        if not (min(a, b) >= 0 and max(a, b) < K and a != b):
            raise InputError(
                f"a distance is given between sockets {a + 1} and {b + 1}, but the run names only {K} sockets"
            )
        if not length > 0.0:
            raise InputError(f"the distance between sockets {a + 1} and {b + 1} is {length} m; it must be positive")
    return _in_own_axes(_keep_distances(_average_plates(K, keys, X, counts), distances))


def _average_plates(K: int, keys: IntArray, X: Array, counts: Array) -> Array:
    """Put the plates together, the one with the most sockets first; (K, 3)."""
    places = sorted(set(keys[:, 0].tolist()), key=lambda k: -int((keys[:, 0] == k).sum()))
    total, weight = np.zeros((K, 3)), np.zeros(K)
    waiting = list(places)
    while waiting:
        known = weight > 0
        place = max(waiting, key=lambda k: (int(known[keys[keys[:, 0] == k, 1]].sum()), -places.index(k)))
        waiting.remove(place)
        at = np.flatnonzero(keys[:, 0] == place)
        x, socket, w = X[at], keys[at, 1], counts[at]
        common = known[socket]
        if known.any() and not common.any():
            raise NoSolutionError(
                f"plate {place + 1} shares no socket with the others; positions of the sockets would help"
            )
        if known.any():
            shape = total[socket[common]] / weight[socket[common], None]
            R, t = registration(shape, x[common], w[common])
            x = x @ R.T + t
        np.add.at(total, socket, x * w[:, None])
        np.add.at(weight, socket, w)
    if not (weight > 0).all():
        raise InputError(f"socket {int(np.argmin(weight)) + 1} was never used, so its position cannot be found")
    return total / weight[:, None]


def _keep_distances(shape: Array, distances: tuple[SocketDistance, ...]) -> Array:
    """Return the nearest shape (K, 3) that keeps the distances: Gauss–Newton steps of least norm."""
    if not distances:
        return shape
    a, b = (np.array([d[k] for d in distances], dtype=int) for k in (0, 1))
    wanted, row = np.array([d[2] for d in distances]), np.arange(len(distances))
    for _ in range(50):
        apart = shape[a] - shape[b]
        length = np.linalg.norm(apart, axis=1)
        u = apart / np.maximum(length, 1e-9)[:, None]
        J = np.zeros((len(distances), *shape.shape))
        J[row, a], J[row, b] = u, -u
        shape = shape + (np.linalg.pinv(J.reshape(len(row), -1), rcond=1e-9) @ (wanted - length)).reshape(shape.shape)
    return shape


def _in_own_axes(shape: Array) -> Array:
    """Return the shape (K, 3) with its first socket at the origin, the second on +x, the third in the xy-plane."""
    apart = shape - shape[0]
    axes = np.zeros((0, 3))
    for v in (*apart[1:], *np.eye(3)):
        rest = v - axes.T @ (axes @ v)
        if len(axes) < 2 and np.linalg.norm(rest) > 1e-3:
            axes = np.vstack([axes, rest / np.linalg.norm(rest)])
    return np.asarray(apart @ np.vstack([axes, np.cross(axes[0], axes[1])]).T)


_SURE = 1e-3  # [m] directions that even such a small error would leave open are not moved at all


@dataclass(frozen=True)
class SocketPlacement:
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
    distances: tuple[SocketDistance, ...] = (),
    offset: Array | None = None,
    p_FM: Array | None = None,
) -> SocketPlacement:
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
    s = flange_poses(p_BF, R_BF, place, point, points=0 if p_FM is None else len(p_FM))
    ball = _check_balls(ball, len(s), p_PS, distances)
    away = np.zeros((len(s), 3)) if offset is None else np.asarray(offset, dtype=float)
    check_arrays((("offset", away, (len(s), 3)),))
    pair = np.unique(np.stack([s.place, ball], axis=1), axis=0, return_inverse=True)
    keys, of_pair = pair[0], pair[1].reshape(-1)
    m = _tool_points(s, of_pair, p_FM)
    X, counts = _socket_medians(s.target_positions(m[None])[0], of_pair, len(keys))
    if p_PS is None:
        p_PS = fit_plate_shape(keys, X, counts, distances)
    R, t = _register_plates(s.n_places, keys, X, counts, p_PS)
    free = np.concatenate([np.full(6 * s.n_places, True), np.full(3 * s.n_points, p_FM is None)])
    problem = FrameProblem(s, p_PS[ball] + away, None, free)
    start = PlacementFrames(R[None], t[None], m[None], np.broadcast_to(np.eye(3), (1, s.n_points, 3, 3)))
    many = problem.take(s.spread(MANY))
    found = refine(many, start.pack(), LAST, floor=_SURE / LIMIT / np.sqrt(len(many.stand)))
    f = unpack_frames(found.state, s)
    error, outlier = find_outliers(problem, found.state)
    missing = undetermined_unknowns(found.jacobian[0], found.error[0], frame_unknowns(s, free))
    rms = float(np.sqrt((error[~outlier] ** 2).mean()))
    names = tuple(str(u).replace("gauge frame", "plate") for u in missing)
    R_BP, p_BP, tool, plate = (read_only(v) for v in (f.R_BG[0], f.p_BG[0], f.p_FM[0], p_PS))
    return SocketPlacement(R_BP, p_BP, tool, plate, rms, outlier, names)


def _check_balls(ball: IntArray, n: int, p_PS: Array | None, distances: tuple[SocketDistance, ...]) -> IntArray:
    """Check the sockets' indices against what is known of them."""
    check_arrays((("ball", ball, (n,)),))
    ball = np.asarray(ball, dtype=np.int64)
    if ball.min() < 0:
        raise InputError(f"ball holds the index {ball.min()}; indices count from 0")
    if p_PS is not None:
        check_arrays((("p_PS", p_PS, (len(p_PS), 3)),))
        if ball.max() >= len(p_PS):
            raise InputError(f"ball holds the index {ball.max()}, but the positions of only {len(p_PS)} are given")
    elif ball.max() > 0 and not distances:
        raise InputError("the run has several sockets, but neither their positions nor their distances are given")
    return ball


def _tool_points(s: FlangePoses, of_pair: IntArray, p_FM: Array | None) -> Array:
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


def _socket_medians(x: Array, of_pair: IntArray, pairs: int) -> tuple[Array, Array]:
    """Return the middle (median) of each pair's points (pairs, 3) [m], and how many there are (pairs,)."""
    X = np.array([np.median(x[of_pair == k], axis=0) for k in range(pairs)])
    return X, np.bincount(of_pair, minlength=pairs).astype(float)


def _register_plates(S: int, keys: IntArray, X: Array, counts: Array, p_PS: Array) -> tuple[Array, Array]:
    """Return R_BP (S, 3, 3) and p_BP (S, 3) of plates by registration; the least turn where it is open."""
    R, t = np.empty((S, 3, 3)), np.empty((S, 3))
    for k in range(S):
        at = keys[:, 0] == k
        R[k], t[k] = registration(X[at], p_PS[keys[at, 1]], counts[at])
    return R, t
