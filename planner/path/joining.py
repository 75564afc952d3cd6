"""Joins the poses of a tour: straight joint legs where they are proven, detours over support poses elsewhere."""

from collections.abc import Sequence

import numpy as np

from planner.path.constraints import Constraints
from planner.path.result import Gaps, Leg, Path
from planner.path.roadmap import Roadmap
from planner.path.shortening import cut, pull
from planner.path.verdict import judge
from planner.units import Array, frozen

PASSES = 6  # of pulling supports towards the straight line
DRAWS = 10_000  # states drawn, twice, where no pool is given
SPREAD = 0.4  # [rad] about the poses
ROOMS = (1e-4, 1e-3)  # [m] beyond the clearance for detours: the judges' distances differ by 1e-5; and a wider try


def join(
    constraints: Constraints, q: Array, order: Sequence[int], *, seed: int = 0, pool: Array | None = None
) -> Path | Gaps:
    """Join poses in the given order by a path that keeps every constraint throughout.

    Straight legs first; then a roadmap (OMPL's PRM, proven lazily) over the pool and the poses, reused for all legs;
    then OMPL's RRT-Connect for what the roadmap leaves apart. Detours are shortened with proven motions only. A leg
    that either engine does not prove in the end is led round once more, further away from everything.

    Args:
        constraints: what every state and motion keeps.
        q: poses (n, N) [rad].
        order: rows of ``q`` in visiting order; a row may come twice.
        seed: of everything random.
        pool: valid states (P, N) [rad] to lead detours over, for instance the candidates; drawn at random if ``None``.

    Returns:
        The path, or the legs that could not be joined and the poses that cannot be reached.
    """
    visits = np.asarray(order, dtype=int)
    legs = np.column_stack([visits[:-1], visits[1:]])
    wanted = np.unique(np.sort(legs, axis=1), axis=0)
    wanted = wanted[wanted[:, 0] != wanted[:, 1]]
    direct = constraints.prove(q[wanted[:, 0]], q[wanted[:, 1]]).proven
    ways = {_pair(leg): q[leg] for leg in wanted[direct]}
    bent = wanted[~direct]
    reasons: tuple[str, ...] = ()
    for room in ROOMS:
        if len(bent):
            wide = constraints.with_room(_common_room(constraints, q[visits], room))
            roadmap = Roadmap.grow(wide, q, _drawn(wide, q, seed) if pool is None else pool, seed)
            found = _detours(roadmap, bent)
            ways |= {_pair(leg): way for leg, way in zip(bent, found, strict=True) if way is not None}
            failed = tuple(_pair(leg) for leg, way in zip(bent, found, strict=True) if way is None)
            if failed:  # in a second try the poses themselves are known to be within reach
                return Gaps(failed, (), reasons) if reasons else _gaps(roadmap, failed, visits)
        path = _path(constraints, q, visits, ways)
        if path.clear:
            return path
        bent, reasons = _unproven(path)
    return Gaps(tuple(_pair(leg) for leg in bent), (), reasons)


def _common_room(constraints: Constraints, q: Array, room: float) -> float:
    """Return ``room`` [m], or none if a pose to be visited (n, N) has not that much itself."""
    return 0.0 if constraints.world.near(q, constraints.clearance + room).any() else room


def _unproven(path: Path) -> tuple[np.ndarray, tuple[str, ...]]:
    """Legs (m, 2) with a motion that an engine does not prove, smaller row first, and a sentence for each."""
    last = np.cumsum([len(leg.supports) + 1 for leg in path.legs])
    why: dict[tuple[int, int], str] = {}
    for v in (path.verdict, path.second):
        for motion, failure in zip(v.unproven, v.failures, strict=True):
            leg = path.legs[int(np.searchsorted(last, motion, side="right"))]
            why.setdefault((min(leg.start, leg.end), max(leg.start, leg.end)), f"{v.engine} does not prove {failure}")
    pairs = sorted(pair for pair in why if pair[0] != pair[1])
    return np.array(pairs, dtype=int).reshape(-1, 2), tuple(why[pair] for pair in pairs)


def _detours(roadmap: Roadmap, bent: np.ndarray) -> list[Array | None]:
    """Proven ways (k, N) [rad] for legs (m, 2) that are not straight, shortened; ``None`` where none was found."""
    ways = roadmap.ways(bent)
    rows = [k for k, way in enumerate(ways) if way is not None]
    rng = np.random.default_rng(roadmap.seed)
    short = cut(roadmap.constraints, [w for w in ways if w is not None])
    short = cut(roadmap.constraints, pull(roadmap.constraints, short, rng, PASSES))
    for k, way in zip(rows, short, strict=True):
        ways[k] = way
    return ways


def _drawn(constraints: Constraints, q: Array, seed: int) -> Array:
    """Valid states drawn within the joint limits, half of them about the poses (n, N), (P, N) [rad]."""
    robot, rng = constraints.cell.robot, np.random.default_rng(seed)
    low, high = np.maximum(robot.q_lower, -np.pi), np.minimum(robot.q_upper, np.pi)
    uniform = rng.uniform(low, high, (DRAWS, robot.n_joints))
    about = q[rng.integers(len(q), size=DRAWS)] + rng.normal(scale=SPREAD, size=uniform.shape)
    drawn = np.concatenate([uniform, about])
    return np.asarray(drawn[constraints.valid(drawn)])


def _gaps(roadmap: Roadmap, failed: tuple[tuple[int, int], ...], visits: np.ndarray) -> Gaps:
    """Say which legs failed and why, and which poses lie outside the part of the roadmap that holds the first pose."""
    part = roadmap.parts()
    lost = np.unique(visits[part[visits] != part[visits[0]]])
    if len(lost) == len(np.unique(visits)) - 1 > 1:  # it is the first pose that is cut off
        lost = visits[:1]
    a, b = np.array(failed).T
    constraints, q = roadmap.constraints, roadmap.graph.q[roadmap.place]
    proof = constraints.prove(q[a], q[b])
    reasons = tuple(f"no way found; straight: {constraints.failure(proof, k)}" for k in range(len(failed)))
    return Gaps(failed, tuple(lost.tolist()), reasons)


def _path(constraints: Constraints, q: Array, visits: np.ndarray, ways: dict[tuple[int, int], Array]) -> Path:
    """String the legs together and have the whole judged by both engines."""
    points, node, legs = [q[visits[0]][None]], [visits[:1]], []
    for a, b in zip(visits[:-1].tolist(), visits[1:].tolist(), strict=True):
        way = ways[min(a, b), max(a, b)] if a != b else q[[a, b]]
        supports = (way if a <= b else way[::-1])[1:-1]
        legs.append(Leg(a, b, frozen(supports)))
        points += [supports, q[b][None]]
        node.append(np.append(np.full(len(supports), -1), b))
    whole = np.concatenate(points)
    number = np.concatenate(node)
    number.setflags(write=False)
    return Path(frozen(whole), number, tuple(legs), *judge(constraints, whole))


def _pair(leg: np.ndarray) -> tuple[int, int]:
    return int(leg[0]), int(leg[1])
