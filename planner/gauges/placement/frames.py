"""Where a tracker stands and where its targets sit on the tool, from any start.

Where plates of sockets stand, and the point that sits in them on the tool: no start needed.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.common.errors import InputError
from planner.common.units import Array, IntArray, read_only
from planner.gauges.placement.lengths import solve_by_reweighting
from planner.gauges.placement.solver import (
    LAST,
    MANY_ROWS,
    OPEN_SIGMA,
    FlangePoses,
    PlacementFrames,
    PlacementUnknown,
    Schedule,
    UnknownKind,
    find_placement,
    largest_group,
    outlier_limit,
    refine,
    robust_scale,
    tool_grid,
    unpack_frames,
)
from planner.kinematics.geometry import exp3, log3, nearest_rotation, registration, skew


def frame_starts(s: FlangePoses, p_GM: Array, R_GM: Array | None, p_FM: Array | None) -> PlacementFrames:
    """Return k complete starts: closed forms for the largest (place, point) pair, and a grid of tool points."""
    main = s.largest_pair()
    pair = s.take(main)
    P, M = int(pair.place[0]), int(pair.point[0])
    grid = tool_grid() if p_FM is None else p_FM[None, M]
    seeds = np.full((len(grid), s.n_points, 3), np.nan)
    seeds[:, M] = grid
    if p_FM is not None:
        seeds[:] = p_FM
    R, t, m = _complete_frames(s, p_GM, seeds, np.full((len(seeds), s.n_places, 3, 3), np.nan))
    closed = [linear_rotation_start(pair, p_GM[main])]
    if R_GM is not None:
        closed.append(hand_eye(pair, R_GM[main]))
    R_seed, m_seed = np.full((len(closed), s.n_places, 3, 3), np.nan), np.full((len(closed), s.n_points, 3), np.nan)
    R_seed[:, P] = closed
    if p_FM is not None:
        m_seed[:] = p_FM
    R2, t2, m2 = _complete_frames(s, p_GM, m_seed, R_seed)
    R, t, m = np.concatenate([R2, R]), np.concatenate([t2, t]), np.concatenate([m2, m])
    return PlacementFrames(R, t, m, _probe_turns(s, R, R_GM))


def linear_rotation_start(s: FlangePoses, p_GM: Array) -> Array:
    """Return R_BG (3, 3) of one pair from readings that are linear in (R_GB, R_GB ⊗ p_FM, t): 13 unknowns an axis."""
    n = len(s)
    p = s.p_BF - s.p_BF.mean(axis=0)
    columns = np.broadcast_to(np.concatenate([p, s.R_BF.reshape(n, 9)], axis=1), (3, n, 12))
    R_GB = solve_by_reweighting(columns, p_GM.T)[:, :3]
    return nearest_rotation(R_GB.T)


def hand_eye(s: FlangePoses, R_GM: Array) -> Array:
    """Return R_BG (3, 3) of one pair from R_BF R_FM = R_BG R_GM, whatever R_FM is.

    Source: Shah, J. Mechanisms Robotics 5 (2013) 031007: the strongest singular vectors of Σ R_BF ⊗ R_GM.
    """
    product = np.einsum("nij,nkl->ikjl", s.R_BF, R_GM).reshape(9, 9)
    left = np.linalg.svd(product)[0][:, 0].reshape(3, 3)
    return nearest_rotation(left * np.sign(np.linalg.det(left) or 1.0))


def _complete_frames(s: FlangePoses, p_GM: Array, m: Array, R: Array) -> tuple[Array, Array, Array]:
    """Fill what is NaN in m (k, T, 3) and R (k, S, 3, 3): one place or point after the other, from those known."""
    t = np.full((*R.shape[:2], 3), np.nan)
    known_m, known_R = np.isfinite(m[0, :, 0]), np.isfinite(R[0, :, 0, 0])
    known_t = np.zeros(s.n_places, dtype=bool)
    while not (known_m.all() and known_t.all()):
        place_next = largest_group(s.place, known_m[s.point] & ~known_t[s.place])
        point_next = largest_group(s.point, known_t[s.place] & ~known_m[s.point])
        if place_next is not None:
            k, at = place_next
            R[:, k], t[:, k] = _register_place(s.take(at), p_GM[at], m, R[:, k])
            known_t[k] = True
        elif point_next is not None:
            k, at = point_next
            to = np.einsum("knij,nj->kni", R[:, s.place[at]], p_GM[at]) + t[:, s.place[at]] - s.p_BF[at]
            m[:, k] = np.median(np.einsum("nji,knj->kni", s.R_BF[at], to), axis=1)
            known_m[k] = True
        elif (known_R & ~known_t).any():
            k = int(np.flatnonzero(known_R & ~known_t)[0])
            at = s.largest_pair()
            m[:, s.point[at[0]]], t[:, k] = _point_and_origin(s.take(at), p_GM[at], R[:, k])
            known_m[s.point[at[0]]] = known_t[k] = True
        elif not known_m.all():
            first = int(np.argmin(known_m))
            m[:, first] = 0.0
            known_m[first] = True
        else:
            R[:, ~known_t], t[:, ~known_t] = np.eye(3), 0.0
            known_t[:] = True
    return R, t, m


def _register_place(s: FlangePoses, p_GM: Array, m: Array, R: Array) -> tuple[Array, Array]:
    """Return R_BG (k, 3, 3) and p_BG (k, 3) of one place from known points, reweighted; a known R is kept."""
    x = s.target_positions(m)
    y = np.broadcast_to(p_GM, x.shape)
    weight = np.ones(x.shape[:2])
    fixed = bool(np.isfinite(R).all())
    for _ in range(5):
        if not fixed:
            R, t = registration(x, y, weight)
        else:
            away = x - np.einsum("kij,nj->kni", R, p_GM)
            t = np.einsum("kn,kni->ki", weight, away) / weight.sum(axis=1)[:, None]
        r = np.linalg.norm(x - np.einsum("kij,nj->kni", R, p_GM) - t[:, None], axis=2)
        weight = np.minimum(1.0, (np.median(r, axis=1, keepdims=True) + 1e-9) / (r + 1e-9))
    return R, t


def _point_and_origin(s: FlangePoses, p_GM: Array, R: Array) -> tuple[Array, Array]:
    """Return p_FM (k, 3) and p_BG (k, 3) of one pair under known rotations R_BG (k, 3, 3): linear, least norm."""
    k, n = len(R), len(s)
    b = np.einsum("kij,nj->kni", R, p_GM) - s.p_BF
    columns = np.concatenate([s.R_BF, np.broadcast_to(-np.eye(3), (n, 3, 3))], axis=2).reshape(3 * n, 6)
    x = np.linalg.lstsq(columns, b.reshape(k, 3 * n).T, rcond=1e-9)[0].T
    return x[:, :3], x[:, 3:]


def _probe_turns(s: FlangePoses, R: Array, R_GM: Array | None) -> Array:
    """Return R_FM (k, T, 3, 3): the mean over the samples under the known R_BG."""
    k = len(R)
    out = np.broadcast_to(np.eye(3), (k, s.n_points, 3, 3)).copy()
    if R_GM is not None:
        each = np.einsum("nji,knjl,nlm->knim", s.R_BF, R[:, s.place], R_GM, optimize=True)
        for point in range(s.n_points):
            out[:, point] = nearest_rotation(each[:, s.point == point].sum(axis=1))
    return out


@dataclass(frozen=True)
class FrameProblem:
    """R_BF p_FM + p_BF = R_BG p_GM + p_BG, and R_BF R_FM = R_BG R_GM where the probe gives its orientation.

    A step is (turns of R_BG in the base's axes (3S), p_BG (3S), p_FM (3T), turns of R_FM in the flange's axes (3T)).

    Attributes:
        stand: flange poses.
        p_GM: readings, (n, 3) [m]; ``R_GM`` (n, 3, 3) or ``None``.
        free: which columns of the step move, bool; the last 3T are there only with orientation.

    An angle of 1 mrad counts like 1 mm: what a joint's error does at a metre's reach.
    """

    stand: FlangePoses
    p_GM: Array
    R_GM: Array | None
    free: np.ndarray

    @property
    def unknowns(self) -> tuple[PlacementUnknown, ...]:
        """What each free column of a step belongs to."""
        S, T = self.stand.n_places, self.stand.n_points
        kinds: tuple[tuple[UnknownKind, int], ...] = (("rotation", S), ("position", S), ("point", T), ("turn", T))
        owner = [PlacementUnknown(kind, k) for kind, count in kinds for k in range(count) for _ in range(3)]
        return tuple(o for o, f in zip(owner, self.free, strict=False) if f)

    def take(self, which: np.ndarray) -> "FrameProblem":
        """Return the problem of only the rows ``which``."""
        R_GM = None if self.R_GM is None else self.R_GM[which]
        return replace(self, stand=self.stand.take(which), p_GM=self.p_GM[which], R_GM=R_GM)

    def evaluate(self, state: Array) -> tuple[Array, Array]:
        """Return residuals (k, n, 3 or 6) [m] and derivatives."""
        s, f, k = self.stand, unpack_frames(state, self.stand), len(state)
        S, T, n = s.n_places, s.n_points, len(s)
        A = f.R_BG[:, s.place]
        reading = np.matmul(A, self.p_GM[..., None])[..., 0]
        r = s.target_positions(f.p_FM) - reading - f.p_BG[:, s.place]
        d = 3 if self.R_GM is None else 6
        J = np.zeros((k, n, d, 6 * S + (3 if d == 3 else 6) * T))
        row, axis = np.arange(n)[:, None, None], np.arange(3)[None, :, None]
        of_place, of_point = 3 * s.place[:, None, None] + np.arange(3), 3 * s.point[:, None, None] + np.arange(3)
        J[:, row, axis, of_place] = skew(reading)
        J[:, row, axis, 3 * S + of_place] = -np.eye(3)
        J[:, row, axis, 6 * S + of_point] = s.R_BF
        if self.R_GM is not None:
            probe = np.matmul(s.R_BF, f.R_FM[:, s.point])
            turn = log3(np.matmul(probe, np.matmul(A, self.R_GM).swapaxes(-1, -2)))
            r = np.concatenate([r, turn], axis=2)
            J[:, row, 3 + axis, of_place] = -np.eye(3)  # exact where the residual is small
            J[:, row, 3 + axis, 6 * S + 3 * T + of_point] = s.R_BF
        return r, J[..., self.free]

    def advance(self, state: Array, step: Array) -> Array:
        """Return the moved states (k, D)."""
        s, k = self.stand, len(state)
        S, T = s.n_places, s.n_points
        full = np.zeros((k, 6 * S + 6 * T))
        full[:, : len(self.free)][:, self.free] = step
        turn_G, p_BG, p_FM, turn_M = (
            v.reshape(k, -1, 3) for v in np.split(full, np.cumsum([3 * S, 3 * S, 3 * T]), axis=1)
        )
        f = unpack_frames(state, s)
        return PlacementFrames(exp3(turn_G) @ f.R_BG, f.p_BG + p_BG, f.p_FM + p_FM, exp3(turn_M) @ f.R_FM).pack()


# weights that a round of candidates is refined by, and how many candidates go on
_ROUNDS: tuple[tuple[Schedule, int], ...] = (((), 12), (((8, "huber"), (8, "huber")), 3))


@dataclass(frozen=True)
class FramePlacement:
    """Where the gauge's frames G stand, and how the targets or probes M sit on the flange.

    Attributes:
        R_BG, p_BG: frames in the base frame, (S, 3, 3) and (S, 3) [m].
        p_FM, R_FM: targets on the flange, (T, 3) [m] and (T, 3, 3), unturned where only positions are read.
        rms: of the distances that are not outliers [m].
        outlier: readings beyond about 5.6 robust standard deviations, 6.4 with orientations, (n,) bool.
    """

    R_BG: Array
    p_BG: Array
    p_FM: Array
    R_FM: Array
    rms: float
    outlier: np.ndarray


def place_frames(
    stand: FlangePoses, p_GM: Array, p_FM: Array | None = None, R_GM: Array | None = None
) -> FramePlacement:
    """Find frames and targets: R_BG p_GM + p_BG = R_BF p_FM + p_BF, with orientations also R_BG R_GM = R_BF R_FM.

    Starts: readings are linear in (R_GB, R_GB ⊗ p_FM, t); registration (Umeyama) for a grid of tool points; with
    orientations robot-world/hand-eye by singular vectors (Shah 2013). All are refined at once, and the one with the
    least robust residual is kept.

    Args:
        stand: flange poses by the nominal robot, with the station and the target on the tool of each.
        p_GM, R_GM: readings in the gauge's own frame, (n, 3) [m], (n, 3, 3) where orientations are read.
        p_FM: targets on the flange where known (then held), (T, 3) [m].

    Raises:
        InputError: there are fewer readings than unknowns.
        NoSolutionError: the poses leave a direction open; the sentence says which and what would help.
    """
    s, d = stand, 3 if R_GM is None else 6
    free = [np.full(6 * s.n_places, True), np.full(3 * s.n_points, p_FM is None)]
    free += [] if R_GM is None else [np.full(3 * s.n_points, True)]
    problem = FrameProblem(s, p_GM, R_GM, np.concatenate(free))
    if d * len(s) < problem.free.sum():
        raise InputError(
            f"{len(s)} readings of {d} numbers cannot place {problem.free.sum()} unknowns; more poses would help"
        )
    # 80: rows for the many starts
    state = find_placement(
        problem, lambda many: frame_starts(many.stand, many.p_GM, many.R_GM, p_FM).pack(), 80, _ROUNDS
    )
    f = unpack_frames(state, s)
    error, outlier = find_outliers(problem, state)
    if R_GM is not None:
        A = f.R_BG[0, s.place]
        gap = s.target_positions(f.p_FM)[0] - np.einsum("nij,nj->ni", A, p_GM) - f.p_BG[0, s.place]
        error = np.linalg.norm(gap, axis=1)
    rms = float(np.sqrt((error[~outlier] ** 2).mean()))
    R_BG, p_BG, m, R = (read_only(v[0]) for v in (f.R_BG, f.p_BG, f.p_FM, f.R_FM))
    return FramePlacement(R_BG, p_BG, m, R, rms, outlier)


def find_outliers(problem: FrameProblem, state: Array) -> tuple[Array, np.ndarray]:
    """Return all rows' block norms (n,) [m] and which are outliers (n,), in chunks so that memory stays flat."""
    n, d, chunk = len(problem.stand), 3 if problem.R_GM is None else 6, 20_000
    parts = [problem.take(np.arange(k, min(n, k + chunk))).evaluate(state)[0][0] for k in range(0, n, chunk)]
    error = np.linalg.norm(np.concatenate(parts), axis=1)
    return error, error > outlier_limit(d) * robust_scale(error, d)[0]


def are_collinear(p: Array) -> bool:
    """Tell whether points (n, 3) lie nearly on one line."""
    size = np.linalg.svd(p - p.mean(axis=0), compute_uv=False)
    return bool(size[1] < 0.05 * size[0])  # of their spread, by which points must leave one line


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
