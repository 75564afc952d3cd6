"""Linear and closed-form solutions from which frames and tool points start."""

import numpy as np

from planner.common.units import Array
from planner.gauges.placement.flange_poses import FlangePoses, PlacementFrames, largest_group, tool_grid
from planner.gauges.placement.lengths import solve_reweighted
from planner.gauges.placement.rotations import nearest_rotation, registration


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
    R_GB = solve_reweighted(columns, p_GM.T)[:, :3]
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
