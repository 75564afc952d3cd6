"""Where a length gauge's fixtures stand and where its ball sits on the tool, from any start."""

from dataclasses import dataclass

import numpy as np

from planner.errors import InputError
from planner.placing.bar_problem import BarProblem, lifted, packed, trilateration, unpacked
from planner.placing.inputs import IntArray, Stand, directions, rows, stand, tool_grid
from planner.placing.open import Unknown, demand
from planner.placing.solver import Refined, best_first, cut_of, refine, scale_of
from planner.units import Array, frozen

FEW, MANY = 100, 400  # rows for the many starts, and for the few that are left
TRIED, KEPT = 24, 6  # starts left after each of the first two rounds
_FIRST, _NEXT = ((6, "huber"),), ((7, "huber"), (7, "huber"))
_LAST = ((15, "huber"), (20, "tukey"), (20, "tukey"))
_REACHES = (0.3, 0.7)  # [m] distances to start from where the bar's zero is unknown
_TIE = 0.02  # relative difference of rms below which two places explain the lengths alike


@dataclass(frozen=True)
class LengthPlacing:
    """Where the gauge stands.

    Attributes:
        p_BX: fixtures in the base frame, (S, 3) [m].
        p_FM: ball on the flange, (T, 3) [m].
        zero: of the bar [m], one for all fixtures.
        rms: of the residuals that are not outliers [m].
        outlier: residuals beyond about 4.7 robust standard deviations, (n,) bool.
    """

    p_BX: Array
    p_FM: Array
    zero: float
    rms: float
    outlier: np.ndarray


def place_lengths(
    p_BF: Array,
    R_BF: Array,
    length: Array,
    place: IntArray,
    point: IntArray,
    p_FM: Array | None = None,
    p_BX: Array | None = None,
    zero_known: bool = False,
    nominal_FM: Array | None = None,
    nominal_BX: Array | None = None,
) -> LengthPlacing:
    """Find fixtures, ball on the tool and zero of a bar: length = |R_BF p_FM + p_BF − p_BX| + zero.

    Starts: squared lengths, linear in products of the unknowns (17 of them), trilateration for a grid of tool points,
    and fixtures in 14 directions; all are refined at once, and the one with the least robust residual is kept.

    Args:
        p_BF, R_BF: flange poses by the nominal robot, (n, 3) [m], (n, 3, 3).
        length: readings, (n,) [m].
        place, point: which fixture, which ball on the tool, (n,) int.
        p_FM: balls on the flange where known (then held), (T, 3) [m].
        p_BX: fixtures where known (then held), (S, 3) [m].
        zero_known: whether the lengths are absolute (the zero is held at 0).
        nominal_FM, nominal_BX: where they are thought to be, (T, 3) and (S, 3) [m]: one more start, and the
            judge between mirror solutions that explain the lengths alike.

    Raises:
        InputError: shapes, numbers or indices are wrong, or there are fewer lengths than unknowns.
        NoSolutionError: the poses leave a direction open; the sentence says which and what would help.
    """
    given = tuple(0 if v is None else len(v) for v in (p_BX, p_FM))
    s = stand(p_BF, R_BF, place, point, *given)
    rows((("length", length, (len(s),)),))
    free = np.concatenate(
        [np.full(3 * s.n_points, p_FM is None), np.full(3 * s.n_places, p_BX is None), [not zero_known]]
    )
    if len(s) < free.sum():
        raise InputError(f"{len(s)} lengths cannot place a gauge of {free.sum()} unknowns; more poses would help")
    few, many = s.spread(FEW), s.spread(MANY)
    starts = _starts(s.take(many), length[many], p_FM, p_BX, zero_known)
    nominal = _nominal(s, p_FM, p_BX, nominal_FM, nominal_BX)
    if nominal is not None:
        starts = np.concatenate([packed(*nominal, np.zeros(1)), starts])
    if not free.any():
        starts = starts[:1]
    problem = BarProblem(s.take(few), length[few], free)
    found = refine(problem, starts, _FIRST)
    found = refine(problem, found.state[best_first(found, 1)[:TRIED]], _NEXT)
    state = found.state[best_first(found, 1)[:KEPT]]
    found = refine(BarProblem(s.take(many), length[many], free), state, _LAST)
    best = _chosen(found, s, nominal)
    demand(best.jacobian[0], best.error[0], _unknowns(s, free), s.take(many))
    return _placing(s, length, best.state[:1])


def _starts(s: Stand, length: Array, p_FM: Array | None, p_BX: Array | None, zero_known: bool) -> Array:
    """Return the starts (k, D): seeds of what is thinkable, completed by trilateration."""
    seeds = []
    T, S = s.n_points, s.n_places
    zero = np.full(1, 0.0 if zero_known else np.nan)

    def seed(m: Array, X: Array, z: Array) -> None:
        m = np.broadcast_to(m if p_FM is None else p_FM, (len(m), T, 3)).copy()
        X = np.broadcast_to(X if p_BX is None else p_BX, (len(m), S, 3)).copy()
        seeds.append(_completed(s, length, m, X, np.broadcast_to(z, len(m)).copy()))

    open_m, open_X = np.full((1, T, 3), np.nan), np.full((1, S, 3), np.nan)
    main = int(np.argmax(np.bincount(s.point)))
    grid = tool_grid() if p_FM is None else np.zeros((1, 3))
    of_main = np.broadcast_to(open_m, (len(grid), T, 3)).copy()
    of_main[:, main] = grid
    if p_FM is None or p_BX is None:
        pair = s.take(_largest_pair(s))
        m, X, z = lifted(pair, length[_largest_pair(s)])
        both_m, both_X = np.repeat(open_m, 2, axis=0), np.repeat(open_X, 2, axis=0)
        both_m[:, pair.point[0]], both_X[:, pair.place[0]] = m, X
        seed(both_m, both_X, zero if zero_known else z)
    if p_FM is None and p_BX is not None:
        seed(open_m, open_X, zero)
        seed(np.broadcast_to(grid[:, None], (len(grid), T, 3)), open_X, zero)
    seed(of_main, open_X, zero)
    if p_BX is None:
        reach = (float(length.mean()),) if zero_known else _REACHES
        middle = s.carried(np.zeros((1, T, 3)) if p_FM is None else p_FM[None])[0]
        centre = np.array([middle[s.place == k].mean(axis=0) if np.any(s.place == k) else middle[0] for k in range(S)])
        for r in reach:
            X = centre + r * directions()[:, None]
            seed(np.zeros((len(X), T, 3)), X, zero)
    return np.concatenate(seeds)


def _completed(s: Stand, length: Array, m: Array, X: Array, zero: Array) -> Array:
    """Fill what is NaN in the seeds: fixtures from known tool points and tool points from known fixtures."""
    known_m, known_X = np.isfinite(m[0, :, 0]), np.isfinite(X[0, :, 0])
    while not (known_m.all() and known_X.all()):
        ready = known_m[s.point] & ~known_X[s.place]
        if ready.any():
            k = int(np.argmax(np.bincount(s.place[ready])))
            at = np.flatnonzero(ready & (s.place == k))
            X[:, k], zero = trilateration(s.take(at).carried(m), length[at], zero)
            known_X[k] = True
            continue
        ready = ~known_m[s.point] & known_X[s.place]
        if ready.any():
            k = int(np.argmax(np.bincount(s.point[ready])))
            at = np.flatnonzero(ready & (s.point == k))
            to = X[:, s.place[at]] - s.p_BF[at]
            m[:, k], zero = trilateration(np.einsum("nji,knj->kni", s.R_BF[at], to), length[at], zero)
            known_m[k] = True
        elif not known_m.all():
            first = int(np.argmin(known_m))
            m[:, first], known_m[first] = 0.0, True
        else:
            X[:, ~known_X], known_X[:] = 0.0, True
    if not np.isfinite(zero).all():
        distance = np.linalg.norm(s.carried(m) - X[:, s.place], axis=2)
        zero = np.median(length - distance, axis=1)
    return packed(m, X, zero)


def _largest_pair(s: Stand) -> IntArray:
    """Return the rows of the (fixture, ball) pair with the most samples."""
    pair = s.place * s.n_points + s.point
    return np.flatnonzero(pair == np.argmax(np.bincount(pair)))


def _nominal(
    s: Stand, p_FM: Array | None, p_BX: Array | None, nominal_FM: Array | None, nominal_BX: Array | None
) -> tuple[Array, Array] | None:
    """Return p_FM (1, T, 3) and p_BX (1, S, 3) as they are thought to be, or ``None`` where one of them is not."""
    m, X = nominal_FM if p_FM is None else p_FM, nominal_BX if p_BX is None else p_BX
    if m is None or X is None:
        return None
    rows((("nominal_FM", m, (s.n_points, 3)), ("nominal_BX", X, (s.n_places, 3))))
    return np.asarray(m, dtype=float)[None], np.asarray(X, dtype=float)[None]


def _chosen(found: Refined, s: Stand, nominal: tuple[Array, Array] | None) -> Refined:
    """Return the best state; among those that explain the lengths alike, the one nearest to the nominal."""
    order = best_first(found, 1)
    if nominal is None:
        return found.take(order[:1])
    limit = cut_of(1) * scale_of(found.error, 1).min()
    rms = np.sqrt((np.minimum(found.error, limit) ** 2).mean(axis=1))
    alike = order[rms[order] <= rms[order[0]] * (1 + _TIE) + 1e-9]
    m, X, _ = unpacked(found.state[alike], s)
    away = ((m - nominal[0]) ** 2).sum(axis=(1, 2)) + ((X - nominal[1]) ** 2).sum(axis=(1, 2))
    return found.take(alike[np.argmin(np.round(away, 9))][None])


def _unknowns(s: Stand, free: np.ndarray) -> tuple[Unknown, ...]:
    """Return what each free column belongs to."""
    owner = [Unknown("point", t) for t in range(s.n_points) for _ in range(3)]
    owner += [Unknown("fixture", k) for k in range(s.n_places) for _ in range(3)]
    return tuple(o for o, f in zip([*owner, Unknown("zero", 0)], free, strict=True) if f)


def _placing(s: Stand, length: Array, state: Array) -> LengthPlacing:
    """Judge all rows with the state (1, D)."""
    m, X, zero = unpacked(state, s)
    error = np.abs(np.linalg.norm(s.carried(m)[0] - X[0, s.place], axis=1) + zero[0] - length)
    outlier = error > cut_of(1) * scale_of(error, 1)[0]
    rms = float(np.sqrt((error[~outlier] ** 2).mean()))
    return LengthPlacing(frozen(X[0]), frozen(m[0]), float(zero[0]), rms, outlier)
