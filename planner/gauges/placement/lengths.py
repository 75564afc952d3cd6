"""Where the fixtures of a length gauge stand and where its ball sits on the tool, from any start."""

from dataclasses import dataclass, replace

import numpy as np

from planner.common.errors import InputError
from planner.common.robust import HUBER_SIGMAS, MEDIAN_NORM, huber_weights
from planner.common.units import Array, IntArray, read_only
from planner.gauges.placement.solver import (
    FlangePoses,
    PlacementUnknown,
    Schedule,
    directions,
    find_placement,
    largest_group,
    tool_grid,
)


@dataclass(frozen=True)
class BarProblem:
    """length = |R m + p − X| + zero; a state is (m (3T), X (3S), zero), of which ``free`` (bool) move."""

    stand: FlangePoses
    length: Array
    free: np.ndarray

    @property
    def unknowns(self) -> tuple[PlacementUnknown, ...]:
        """What each free column belongs to."""
        owner = [PlacementUnknown("point", t) for t in range(self.stand.n_points) for _ in range(3)]
        owner += [PlacementUnknown("fixture", k) for k in range(self.stand.n_places) for _ in range(3)]
        return tuple(o for o, f in zip([*owner, PlacementUnknown("zero", 0)], self.free, strict=True) if f)

    def take(self, which: IntArray) -> "BarProblem":
        """Return the problem of only the rows ``which``."""
        return replace(self, stand=self.stand.take(which), length=self.length[which])

    def evaluate(self, state: Array) -> tuple[Array, Array]:
        """Return residuals (k, n, 1) [m] and derivatives (k, n, 1, P)."""
        s, k = self.stand, len(state)
        m, X, zero = unpack_bar(state, s)
        apart = s.target_positions(m) - X[:, s.place]
        distance = np.linalg.norm(apart, axis=2)
        u = apart / np.maximum(distance, 1e-9)[..., None]
        J = np.zeros((k, len(s), state.shape[1]))
        row = np.arange(len(s))[:, None]
        J[:, row, 3 * s.point[:, None] + np.arange(3)] = np.matmul(u[..., None, :], s.R_BF)[..., 0, :]
        J[:, row, 3 * (s.n_points + s.place[:, None]) + np.arange(3)] = -u
        J[:, :, -1] = 1.0
        return (distance + zero[:, None] - self.length)[..., None], J[:, :, None, self.free]

    def advance(self, state: Array, step: Array) -> Array:
        """Return the moved states (k, D)."""
        out = state.copy()
        out[:, self.free] += step
        return out


def unpack_bar(state: Array, stand: FlangePoses) -> tuple[Array, Array, Array]:
    """Return p_FM (k, T, 3), p_BX (k, S, 3) and the zero (k,) of states (k, D)."""
    T, k = stand.n_points, len(state)
    return state[:, : 3 * T].reshape(k, T, 3), state[:, 3 * T : -1].reshape(k, -1, 3), state[:, -1]


def pack_bar(p_FM: Array, p_BX: Array, zero: Array) -> Array:
    """Return states (k, D) of :func:`unpack_bar`."""
    k = len(zero)
    return np.concatenate([p_FM.reshape(k, -1), p_BX.reshape(k, -1), zero[:, None]], axis=1)


def trilateration(centre: Array, length: Array, zero: Array) -> tuple[Array, Array]:
    """Locate a point from lengths to known centres; the difference of squared lengths is linear in it.

    L² − |c|² = 2 z L − 2 c·X + (|X|² − z²), reweighted against outliers.

    Args:
        centre: (k, n, 3) [m].
        length: (n,) [m].
        zero: (k,) [m]; NaN: unknown, a column L is added.

    Returns:
        The point (k, 3) and the zero (k,) [m].
    """
    known = bool(np.isfinite(zero).all())
    reach = length - (zero[:, None] if known else 0.0)
    b = reach**2 - (centre**2).sum(axis=2)
    columns = -2.0 * centre
    if not known:
        columns = np.concatenate([columns, np.broadcast_to(2.0 * length[:, None], (*b.shape, 1))], axis=2)
    x = solve_by_reweighting(columns, b)
    return x[:, :3], zero if known else x[:, 3]


def solve_by_reweighting(columns: Array, b: Array) -> Array:
    """Return x (k, P) of columns (k, n, P) x + constant = b (k, n), by least squares with three Huber reweightings."""
    weight = np.ones_like(b)
    for _ in range(4):
        w = weight / weight.sum(axis=1, keepdims=True)
        C = columns - np.einsum("kn,knp->kp", w, columns)[:, None]
        d = b - np.einsum("kn,kn->k", w, b)[:, None]
        Cw = (C * w[..., None]).transpose(0, 2, 1)
        x = np.matmul(np.linalg.pinv(Cw @ C, rcond=1e-11, hermitian=True), Cw @ d[..., None])
        r = np.abs(d - (C @ x)[..., 0])
        scale = np.maximum(np.median(r, axis=1, keepdims=True) / MEDIAN_NORM[1], 1e-12)
        weight = huber_weights(r, HUBER_SIGMAS * scale)
    return np.asarray(x[..., 0])


def linear_bar_start(stand: FlangePoses, length: Array) -> tuple[Array, Array, Array]:
    """Locate tool point and fixture of one pair together, no start needed, from 17 linear unknowns.

    L² − |p|² = 2 z L + 2 (Rᵀp)·m − 2 p·X − 2 Xᵀ R m + constant: the products X mᵀ (9) are taken as unknowns of their
    own, then split into their strongest rank-one part.

    Returns:
        m (2, 3), X (2, 3), zero (2,) [m]: from the linear terms, and with m from the products.
    """
    origin = stand.p_BF.mean(axis=0)
    p, n = stand.p_BF - origin, len(stand)
    turned = np.einsum("nji,nj->ni", stand.R_BF, p)
    columns = np.concatenate([2 * turned, -2 * p, 2 * length[:, None], -2 * stand.R_BF.reshape(n, 9)], axis=1)
    x = solve_by_reweighting(columns[None], (length**2 - (p**2).sum(axis=1))[None])[0]
    m, X, product = x[:3], x[3:6], x[7:].reshape(3, 3)
    by_product = product.T @ X / max(float(X @ X), 1e-12)
    return np.stack([m, by_product]), np.stack([X, X]) + origin, np.full(2, x[6])


# weights that a round of candidates is refined by, and how many candidates go on
_ROUNDS: tuple[tuple[Schedule, int], ...] = ((((6, "huber"),), 24), (((7, "huber"), (7, "huber")), 6))


@dataclass(frozen=True)
class LengthPlacement:
    """Where the gauge stands.

    Attributes:
        p_BX: fixtures in the base frame, (S, 3) [m].
        p_FM: ball on the flange, (T, 3) [m].
        zero: of the bar [m], one for all fixtures.
    """

    p_BX: Array
    p_FM: Array
    zero: float


def place_lengths(
    stand: FlangePoses, length: Array, p_FM: Array | None = None, p_BX: Array | None = None
) -> LengthPlacement:
    """Find fixtures, ball on the tool and zero of a bar: length = |R_BF p_FM + p_BF − p_BX| + zero.

    Starts: squared lengths, linear in products of the unknowns (17 of them), trilateration for a grid of tool points,
    and fixtures in 14 directions; all are refined at once, and the one with the least robust residual is kept.

    Args:
        stand: flange poses by the nominal robot.
        length: readings, (n,) [m].
        p_FM: balls on the flange where known (then held), (T, 3) [m].
        p_BX: fixtures where known (then held), (S, 3) [m].

    Raises:
        InputError: there are fewer lengths than unknowns.
        NoSolutionError: the poses leave a direction open; the sentence says which and what would help.
    """
    s = stand
    free = np.concatenate([np.full(3 * s.n_points, p_FM is None), np.full(3 * s.n_places, p_BX is None), [True]])
    if len(s) < free.sum():
        raise InputError(f"{len(s)} lengths cannot place a gauge of {free.sum()} unknowns; more poses would help")
    # 100: rows for the many starts
    state = find_placement(BarProblem(s, length, free), lambda many: _starts(many, p_FM, p_BX), 100, _ROUNDS)
    m, X, zero = unpack_bar(state, s)
    return LengthPlacement(read_only(X[0]), read_only(m[0]), float(zero[0]))


def _starts(problem: BarProblem, p_FM: Array | None, p_BX: Array | None) -> Array:
    """Return the starts (k, D): seeds of what is thinkable, completed by trilateration."""
    s, length, seeds = problem.stand, problem.length, []
    T, S = s.n_points, s.n_places
    zero = np.full(1, np.nan)

    def add_seeds(m: Array, X: Array, z: Array) -> None:
        """Take more places to start from, where there is room for them."""
        m = np.broadcast_to(m if p_FM is None else p_FM, (len(m), T, 3)).copy()
        X = np.broadcast_to(X if p_BX is None else p_BX, (len(m), S, 3)).copy()
        seeds.append(_complete_seeds(s, length, m, X, np.broadcast_to(z, len(m)).copy()))

    open_m, open_X = np.full((1, T, 3), np.nan), np.full((1, S, 3), np.nan)
    main = int(np.argmax(np.bincount(s.point)))
    grid = tool_grid() if p_FM is None else np.zeros((1, 3))
    of_main = np.broadcast_to(open_m, (len(grid), T, 3)).copy()
    of_main[:, main] = grid
    if p_FM is None or p_BX is None:
        main_pair = s.largest_pair()
        pair = s.take(main_pair)
        m, X, z = linear_bar_start(pair, length[main_pair])
        both_m, both_X = np.repeat(open_m, 2, axis=0), np.repeat(open_X, 2, axis=0)
        both_m[:, pair.point[0]], both_X[:, pair.place[0]] = m, X
        add_seeds(both_m, both_X, z)
    if p_FM is None and p_BX is not None:
        add_seeds(open_m, open_X, zero)
        add_seeds(np.broadcast_to(grid[:, None], (len(grid), T, 3)), open_X, zero)
    add_seeds(of_main, open_X, zero)
    if p_BX is None:
        middle = s.target_positions(np.zeros((1, T, 3)) if p_FM is None else p_FM[None])[0]
        centre = np.array([middle[s.place == k].mean(axis=0) if np.any(s.place == k) else middle[0] for k in range(S)])
        for r in (0.3, 0.7):  # [m] distances to start from where the bar's zero is unknown
            X = centre + r * directions()[:, None]
            add_seeds(np.zeros((len(X), T, 3)), X, zero)
    return np.concatenate(seeds)


def _complete_seeds(s: FlangePoses, length: Array, m: Array, X: Array, zero: Array) -> Array:
    """Fill what is NaN in the seeds: fixtures from known tool points and tool points from known fixtures."""
    known_m, known_X = np.isfinite(m[0, :, 0]), np.isfinite(X[0, :, 0])
    while not (known_m.all() and known_X.all()):
        place_next = largest_group(s.place, known_m[s.point] & ~known_X[s.place])
        point_next = largest_group(s.point, ~known_m[s.point] & known_X[s.place])
        if place_next is not None:
            k, at = place_next
            X[:, k], zero = trilateration(s.take(at).target_positions(m), length[at], zero)
            known_X[k] = True
        elif point_next is not None:
            k, at = point_next
            to = X[:, s.place[at]] - s.p_BF[at]
            m[:, k], zero = trilateration(np.einsum("nji,knj->kni", s.R_BF[at], to), length[at], zero)
            known_m[k] = True
        elif not known_m.all():
            first = int(np.argmin(known_m))
            m[:, first], known_m[first] = 0.0, True
        else:
            X[:, ~known_X], known_X[:] = 0.0, True
    if not np.isfinite(zero).all():
        distance = np.linalg.norm(s.target_positions(m) - X[:, s.place], axis=2)
        zero = np.median(length - distance, axis=1)
    return pack_bar(m, X, zero)
