"""Connects the poses of a tour: straight legs where they are proven, shortened detours over support poses elsewhere."""

from collections.abc import Sequence

import numpy as np

from planner.common.units import Array, round_angles
from planner.motion.path.constraints import Constraints
from planner.motion.path.roadmap import LazyGraph, Roadmap, leg_time
from planner.motion.path.verdict import PathGaps, PathLeg, ProvenPath, judge_path
from planner.motion.tolerances import DETOUR_MARGINS


def cut_corners(constraints: Constraints, paths: Sequence[Array]) -> list[Array]:
    """Leave out supports of proven paths (k, N) [rad] that proven motions between the others make needless."""
    if not paths:
        return []
    start = np.concatenate([[0], np.cumsum([len(w) for w in paths])])
    edges = [s + np.column_stack(np.triu_indices(len(w), 1)) for s, w in zip(start, paths, strict=False)]
    graph = LazyGraph(constraints, np.concatenate(paths), np.concatenate(edges))
    inner = np.setdiff1d(np.arange(start[-1] - 1), start[1:-1] - 1)  # states that are followed by another of their path
    graph.accept(np.column_stack([inner, inner + 1]))
    graph.mark_failures(np.column_stack([start[:-1], start[1:] - 1]))  # the straight leg has failed before
    found = graph.paths(np.column_stack([start[:-1], start[1:] - 1]), 60)  # rounds
    return [graph.q[f] if f else w for f, w in zip(found, paths, strict=True)]


def pull_supports(
    constraints: Constraints, paths: Sequence[Array], rng: np.random.Generator, passes: int
) -> list[Array]:
    """Move the supports of proven paths (k, N) [rad] to where the paths are shorter and still proven."""
    paths = [w.copy() for w in paths]
    for turn in range(passes):
        places = [(k, i) for k, w in enumerate(paths) for i in range(1 + turn % 2, len(w) - 1, 2)]
        if places:
            _pull_once(constraints, paths, places, rng)
    return paths


def _pull_once(
    constraints: Constraints, paths: list[Array], places: list[tuple[int, int]], rng: np.random.Generator
) -> None:
    before, here, after = (np.array([paths[k][i + step] for k, i in places]) for step in (-1, 0, 1))
    tries = _pull_candidates(before, here, after, rng)  # (places, tries, N)
    n, t, N = tries.shape
    ends = [np.broadcast_to(q[:, None], tries.shape).reshape(-1, N) for q in (before, after)]
    flat = tries.reshape(-1, N)
    gain = leg_time(constraints, before, here) + leg_time(constraints, here, after)
    gain = gain[:, None] - (leg_time(constraints, ends[0], flat) + leg_time(constraints, flat, ends[1])).reshape(n, t)
    found = _best_proven(constraints, before, tries, after, np.where(gain > 1e-3 * gain.max(initial=0.0), gain, 0.0))
    for row, (k, i) in enumerate(places):
        if found[row] >= 0:
            paths[k][i] = tries[row, found[row]]


def _best_proven(constraints: Constraints, before: Array, tries: Array, after: Array, gain: Array) -> np.ndarray:
    """Return which of the tries (n, t, N) [rad] gains most of those that are proven from and to their neighbours, (n,).

    −1 where none is, and none is looked at that does not gain: those that gain less are proven only after the others
    have failed, a few of every place at once, since proofs of few motions take as long as those of many.
    """
    few = 4  # tries of a place that are proven together
    found, left = np.full(len(tries), -1), np.sort(gain, axis=1)[:, ::-1]
    order = np.argsort(-gain, axis=1, kind="stable")
    for first in range(0, tries.shape[1], few):
        some = slice(first, first + few)
        row, column = np.nonzero((left[:, some] > 0.0) & (found < 0)[:, None])
        which = order[:, some][row, column]
        there = tries[row, which]
        ends = np.concatenate([before[row], there]), np.concatenate([there, after[row]])
        proven = constraints.prove(*ends).proven.reshape(2, -1).all(axis=0)
        found[row[proven][::-1]] = which[proven][::-1]  # of one place the first, which gains most, is written last
    return found


def _pull_candidates(before: Array, here: Array, after: Array, rng: np.random.Generator) -> Array:
    """Places to try for supports (n, N): towards the straight line, and beside it, (n, tries, N) [rad]."""
    pulls = (0.9, 0.6, 0.35, 0.15)  # part of the way from a support to the straight line between its neighbours
    chord = after - before
    along = np.einsum("ni,ni->n", here - before, chord) / np.maximum(np.einsum("ni,ni->n", chord, chord), 1e-12)
    foot = before + np.clip(along, 0.1, 0.9)[:, None] * chord
    away = foot - here
    straight = [here + p * away for p in pulls]
    size = np.linalg.norm(away, axis=1)[:, None] / np.sqrt(here.shape[1])
    # 2: random neighbours of the support beside each pull
    beside = [here + p * away + 0.5 * size * rng.normal(size=here.shape) for p in pulls for _ in range(2)]
    return np.stack([*straight, *beside], axis=1)


def connect_poses(
    constraints: Constraints, q: Array, order: Sequence[int], *, seed: int = 0, pool: Array | Roadmap | None = None
) -> ProvenPath | PathGaps:
    """Join poses in the given order by a path that keeps every constraint throughout.

    Straight legs first; then a roadmap over the pool and the poses, proven lazily and reused for all legs. Then OMPL's
    RRT-Connect for what the roadmap leaves apart. Detours are shortened with proven motions only. A leg
    that either engine does not prove in the end is led round once more, further away from everything.

    Args:
        constraints: what every state and motion keeps.
        q: poses (n, N) [rad].
        order: rows of ``q`` in visiting order; a row may come twice.
        seed: of everything random.
        pool: valid states (P, N) [rad] to lead detours over, for instance the candidates; drawn at random if ``None``.
            A roadmap of the same bodies keeps and learns what is proven of its edges.

    Returns:
        The path, or the legs that could not be joined and the poses that cannot be reached.
    """
    visits = np.asarray(order, dtype=int)
    legs = np.column_stack([visits[:-1], visits[1:]])
    wanted = np.unique(np.sort(legs, axis=1), axis=0)
    wanted = wanted[wanted[:, 0] != wanted[:, 1]]
    direct = constraints.prove(q[wanted[:, 0]], q[wanted[:, 1]]).proven
    paths = {_pair(leg): q[leg] for leg in wanted[direct]}
    bent = wanted[~direct]
    reasons: tuple[str, ...] = ()
    for room in DETOUR_MARGINS:
        if len(bent):
            wide = add_room(constraints, q[visits], room)
            roadmap = _roadmap_about(wide, q, pool, seed)
            found = _find_detours(roadmap, bent)
            paths |= {_pair(leg): path for leg, path in zip(bent, found, strict=True) if path is not None}
            failed = tuple(_pair(leg) for leg, path in zip(bent, found, strict=True) if path is None)
            if failed:  # in a second try the poses themselves are known to be within reach
                return PathGaps(failed, (), reasons) if reasons else _describe_gaps(roadmap, failed, visits)
        path = _assemble_path(constraints, q, visits, paths)
        if path.clear:
            return path
        bent, reasons = _unproven_legs(path)
    return PathGaps(tuple(_pair(leg) for leg in bent), (), reasons)


def add_room(constraints: Constraints, q: Array, room: float = DETOUR_MARGINS[0]) -> Constraints:
    """Return the constraints with ``room`` [m] more, if every pose to be visited (n, N) has that much itself."""
    return constraints.with_room(0.0 if constraints.world.find_near(q, constraints.clearance + room).any() else room)


def _roadmap_about(constraints: Constraints, q: Array, pool: Array | Roadmap | None, seed: int) -> Roadmap:
    """Return a roadmap over poses (n, N) [rad] and a pool: the pool itself, where it keeps as much room."""
    if isinstance(pool, Roadmap):
        if pool.constraints.room == constraints.room:
            return pool.with_poses(q, (1, 4, 16))  # near ones, and of a quarter and a sixteenth: they give long edges
        pool = pool.graph.q
    return Roadmap.grow(constraints, q, _draw_states(constraints, q, seed) if pool is None else pool, seed)


def _unproven_legs(path: ProvenPath) -> tuple[np.ndarray, tuple[str, ...]]:
    """Legs (m, 2) with a motion that an engine does not prove, smaller row first, and a sentence for each."""
    last = np.cumsum([len(leg.supports) + 1 for leg in path.legs])
    why: dict[tuple[int, int], str] = {}
    for v in (path.verdict, path.second):
        for motion, failure in zip(v.unproven, v.failures, strict=True):
            leg = path.legs[int(np.searchsorted(last, motion, side="right"))]
            why.setdefault((min(leg.start, leg.end), max(leg.start, leg.end)), f"{v.engine} does not prove {failure}")
    pairs = sorted(pair for pair in why if pair[0] != pair[1])
    return np.array(pairs, dtype=int).reshape(-1, 2), tuple(why[pair] for pair in pairs)


def _find_detours(roadmap: Roadmap, bent: np.ndarray) -> list[Array | None]:
    """Proven paths (k, N) [rad] for legs (m, 2) that are not straight, shortened; ``None`` where none was found."""
    paths = roadmap.paths(bent)
    rows = [k for k, path in enumerate(paths) if path is not None]
    rng = np.random.default_rng(roadmap.seed)
    short = cut_corners(roadmap.constraints, [w for w in paths if w is not None])
    # 18: passes of pulling supports towards the straight line
    short = cut_corners(roadmap.constraints, pull_supports(roadmap.constraints, short, rng, 18))
    for k, path in zip(rows, short, strict=True):
        paths[k] = path
    return paths


def _draw_states(constraints: Constraints, q: Array, seed: int) -> Array:
    """Valid states drawn within the joint limits, half of them about the poses (n, N), (P, N) [rad]."""
    count = 10_000  # states drawn, twice, where no pool is given
    robot, rng = constraints.cell.robot, np.random.default_rng(seed)
    low, high = robot.one_turn
    uniform = rng.uniform(low, high, (count, robot.n_joints))
    about = q[rng.integers(len(q), size=count)] + rng.normal(scale=0.4, size=uniform.shape)  # [rad] about the poses
    drawn = np.concatenate([uniform, about])
    return np.asarray(drawn[constraints.valid(drawn)])


def _describe_gaps(roadmap: Roadmap, failed: tuple[tuple[int, int], ...], visits: np.ndarray) -> PathGaps:
    """Say which legs failed and why, and which poses lie outside the part of the roadmap that holds the first pose."""
    part = roadmap.parts()
    lost = np.unique(visits[part[visits] != part[visits[0]]])
    if len(lost) == len(np.unique(visits)) - 1 > 1:  # it is the first pose that is cut off
        lost = visits[:1]
    a, b = np.array(failed).T
    constraints, q = roadmap.constraints, roadmap.graph.q[roadmap.place]
    proof = constraints.prove(q[a], q[b])
    reasons = tuple(f"no path found; straight: {constraints.failure(proof, k)}" for k in range(len(failed)))
    return PathGaps(failed, tuple(lost.tolist()), reasons)


def _assemble_path(
    constraints: Constraints, q: Array, visits: np.ndarray, paths: dict[tuple[int, int], Array]
) -> ProvenPath:
    """String the legs together and have the whole judged by both engines."""
    points, node, legs = [q[visits[0]][None]], [visits[:1]], []
    for a, b in zip(visits[:-1].tolist(), visits[1:].tolist(), strict=True):
        between = paths[min(a, b), max(a, b)] if a != b else q[[a, b]]
        supports = (between if a <= b else between[::-1])[1:-1]
        legs.append(PathLeg(a, b, round_angles(supports)))
        points += [supports, q[b][None]]
        node.append(np.append(np.full(len(supports), -1), b))
    whole = round_angles(np.concatenate(points))  # judged is what will be driven
    number = np.concatenate(node)
    number.setflags(write=False)
    return ProvenPath(whole, number, tuple(legs), *judge_path(constraints, whole))


def _pair(leg: np.ndarray) -> tuple[int, int]:
    return int(leg[0]), int(leg[1])
