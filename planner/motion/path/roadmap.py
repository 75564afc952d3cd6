"""A roadmap over poses and a pool of valid states whose edges are proven only when a path uses them."""

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from planner.common.units import Array
from planner.motion.path.constraints import Constraints
from planner.motion.path.ompl_planners import join_by_prm, rrt_connect
from planner.motion.timing.leg_times import axis_times
from planner.motion.tolerances import SUPPORT_COST


def leg_time(constraints: Constraints, q_from: Array, q_to: Array) -> Array:
    """Time of straight motions by their slowest limit, with a little of all axes to break ties, (n,) [s]."""
    share = np.abs(q_to - q_from) / constraints.cell.robot.speed
    return np.asarray(constraints.driven_times(q_from, q_to) + 0.02 * share.sum(axis=1))


class Known(IntEnum):
    """What is known of a motion along an edge of the graph."""

    UNKNOWN, PROVEN, BROKEN = 0, 1, 2


class LazyGraph:
    """States and the edges that may join them.

    Args:
        constraints: what edges must keep.
        q: states (V, N) [rad].
        edges: (E, 2) positions in ``q``; each edge once.
    """

    def __init__(self, constraints: Constraints, q: Array, edges: np.ndarray) -> None:
        self.constraints, self.q = constraints, q
        low, high = np.sort(np.asarray(edges, dtype=int), axis=1).T
        self._key = np.unique(low * len(q) + high)
        self.edges = np.column_stack(np.divmod(self._key, len(q)))
        self.known = np.full(len(self.edges), Known.UNKNOWN)
        self._cost = np.full(len(self.edges), np.nan)  # [s] of edges of which it was asked for

    @property
    def cost(self) -> Array:
        """Time of each edge, and what a support costs, (E,) [s]."""
        return self._find_costs(np.arange(len(self.edges)))

    def add_path(self, ends: np.ndarray, path: Array) -> None:
        """Add a proven path (k, N) [rad] between two states that the graph has."""
        inner = len(self.q) + np.arange(len(path) - 2)
        chain = np.concatenate([ends[:1], inner, ends[1:]])
        new = np.column_stack([chain[:-1], chain[1:]])
        self.add_states(path[1:-1], new)
        self.accept(new)

    def add_states(self, q: Array, edges: np.ndarray) -> None:
        """Add states (n, N) [rad], which come last, and edges (m, 2) that may join them."""
        grown = LazyGraph(self.constraints, np.concatenate([self.q, q]), np.concatenate([self.edges, edges]))
        same = grown._rows(self.edges)
        grown.known[same], grown._cost[same] = self.known, self._cost
        self.__dict__.update(grown.__dict__)

    def accept(self, edges: np.ndarray) -> None:
        """Mark edges (n, 2) that are known to be proven; those not in the graph are passed over."""
        self.known[self._rows(edges)] = Known.PROVEN

    def mark_failures(self, edges: np.ndarray) -> None:
        """Mark edges (n, 2) that are known to fail; those not in the graph are passed over."""
        self.known[self._rows(edges)] = Known.BROKEN

    def paths(self, wanted: np.ndarray, rounds: int) -> list[list[int] | None]:
        """Return the shortest proven path for each wanted (from, to) (m, 2), ``None`` where there is none.

        Args:
            wanted: positions of the states to join.
            rounds: searches at most; paths not proven by then are ``None``.
        """
        found: list[list[int] | None] = [None] * len(wanted)
        open_ = list(range(len(wanted)))
        for _ in range(rounds):
            if not open_:
                break
            paths = self._search(wanted[open_])
            asked = [self._rows(np.column_stack([w[:-1], w[1:]])) if w else np.zeros(0, int) for w in paths]
            self._prove(np.unique(np.concatenate([np.zeros(0, int), *asked])))
            later = []
            for k, path, rows in zip(open_, paths, asked, strict=True):
                if path and (self.known[rows] == Known.PROVEN).all():
                    found[k] = path
                elif path:
                    later.append(k)
            open_ = later
        return found

    def parts(self, share: float = 1.0) -> np.ndarray:
        """Number of the connected part of each state, (V,), largest part 0; proves no more edges than that takes.

        After ``share`` of a limit of time what nothing is known against counts as joined: a path is proven anyway.
        """
        start, end = self.q[self.edges.T]
        away = axis_times(start, end, self.constraints.cell.robot.speed)
        while True:
            part = self._parts(self.known == Known.PROVEN)
            a, b = part[self.edges].T
            rows = np.flatnonzero((self.known == Known.UNKNOWN) & (a != b))
            if len(rows) == 0:
                return part
            if self.constraints.limit.must_stop(
                share, "which poses can be joined was not proven for all before they were chosen"
            ):
                return self.number_likely_parts()
            self._prove(_cheapest(rows, part[self.edges[rows]], away[rows], np.bincount(part)))

    def number_likely_parts(self) -> np.ndarray:
        """Number of the connected part of each state, (V,), where all counts as proven that is not known to fail."""
        return self._parts(self.known != Known.BROKEN)

    def _parts(self, good: np.ndarray) -> np.ndarray:
        a, b = self.edges[good].T
        graph = csr_array((np.ones(len(a)), (a, b)), shape=(len(self.q),) * 2)
        part = connected_components(graph, directed=False)[1]
        rank = np.empty(part.max() + 1, dtype=int)
        rank[np.argsort(-np.bincount(part), kind="stable")] = np.arange(part.max() + 1)
        return np.asarray(rank[part])

    def _search(self, wanted: np.ndarray) -> list[list[int] | None]:
        good = np.flatnonzero(self.known != Known.BROKEN)
        a, b = self.edges[good].T
        graph = csr_array((self._find_costs(good), (a, b)), shape=(len(self.q),) * 2)
        sources, row = np.unique(wanted[:, 0], return_inverse=True)
        _, before = dijkstra(graph, directed=False, indices=sources, return_predecessors=True)
        return [_trace_back(before[r], int(goal)) for r, goal in zip(row, wanted[:, 1], strict=True)]

    def _find_costs(self, rows: np.ndarray) -> Array:
        new = rows[np.isnan(self._cost[rows])]
        self._cost[new] = leg_time(self.constraints, *self.q[self.edges[new].T]) + SUPPORT_COST
        return np.asarray(self._cost[rows])

    def _prove(self, rows: np.ndarray) -> None:
        rows = rows[self.known[rows] == Known.UNKNOWN]
        if len(rows):
            a, b = self.edges[rows].T
            self.known[rows] = np.where(self.constraints.prove(self.q[a], self.q[b]).proven, Known.PROVEN, Known.BROKEN)

    def _rows(self, edges: np.ndarray) -> np.ndarray:
        """Positions of those edges (n, 2) that the graph has."""
        low, high = np.sort(np.asarray(edges, dtype=int).reshape(-1, 2), axis=1).T
        key = low * len(self.q) + high
        place = np.minimum(np.searchsorted(self._key, key), len(self._key) - 1)
        return np.asarray(place[self._key[place] == key] if len(self._key) else place[:0])


def _cheapest(rows: np.ndarray, ends: np.ndarray, cost: Array, size: np.ndarray) -> np.ndarray:
    """Of edges between parts, the cheapest one of each part (Borůvka), and more of a larger part."""
    both = np.tile(rows, 2)
    part = ends.T.ravel()
    order = np.lexsort((both, np.tile(cost, 2), part))
    first = np.searchsorted(part[order], part[order])
    return np.asarray(np.unique(both[order][np.arange(len(order)) - first < 1 + size[part[order]] // 8]))


def _trace_back(before: np.ndarray, goal: int) -> list[int] | None:
    """Follow the predecessors back from ``goal``."""
    if before[goal] < 0:
        return None
    path = [goal]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return path[::-1]


MILESTONES = 2000  # states of the pool that a roadmap uses
NEIGHBOURS = 10  # states before it that OMPL joins each to
BOX_MARGIN = 0.5  # [rad] by which RRT-Connect's box exceeds what the roadmap spans


@dataclass
class Roadmap:
    """A probabilistic roadmap (Kavraki et al. 1996) with proofs on demand (Bohlin and Kavraki 2000).

    OMPL's PRM joins the milestones. Its ways are searched here: OMPL 2.0.1's Python binding has no LazyPRM, and its
    PRM asks for one motion at a time, where a batch of them is proven as quickly as one.

    Attributes:
        constraints: what its edges keep.
        graph: states and edges; grows when a bridge is found.
        place: which of its states each pose is, (n,).
        seed: of everything random.
    """

    constraints: Constraints
    graph: LazyGraph
    place: np.ndarray
    seed: int

    @classmethod
    def grow(cls, constraints: Constraints, q: Array, pool: Array, seed: int) -> "Roadmap":
        """Grow a roadmap over poses (n, N) and at most ``MILESTONES`` states of a pool (P, N) [rad]."""
        rng = np.random.default_rng(seed)
        rows = rng.permutation(len(pool))[:MILESTONES]
        states, place = np.unique(np.concatenate([q, pool[rows]]), axis=0, return_inverse=True)
        order = rng.permutation(len(states))  # the first milestones are sparse, and give the roadmap its long edges
        states, place = states[order], np.argsort(order)[place]
        edges = join_by_prm(states / constraints.cell.robot.speed, NEIGHBOURS)
        return cls(constraints, LazyGraph(constraints, states, edges), place[: len(q)], seed)

    def with_poses(self, q: Array, levels: tuple[int, ...] = (1,)) -> "Roadmap":
        """Return the roadmap with the poses (n, N) [rad] for its places; those that it lacks become states of it.

        Both share their states, edges and what is known of them. Each pose is joined to the nearest states, and to the
        nearest of the first half, quarter, … of them, as the ``levels`` say: the fewer, the longer the edges.
        """
        place = np.full(len(q), -1)
        if len(self.graph.q):
            away, nearest = cKDTree(self._axis_times(self.graph.q)).query(self._axis_times(q))
            place = np.where(away > 0.0, -1, nearest)
        new, which = np.unique(q[place < 0], axis=0, return_inverse=True)
        count = len(self.graph.q)
        place[place < 0] = count + which.ravel()
        own = np.unique(place) if len(levels) > 1 else count + np.arange(len(new))
        every = np.concatenate([self.graph.q, new])
        edges = [self._nearest(every, own, len(every) // level) for level in levels]
        self.graph.add_states(new, np.concatenate(edges))
        return replace(self, place=place)

    def _nearest(self, q: Array, own: np.ndarray, count: int) -> np.ndarray:
        """Return edges (m, 2) from the states ``own`` (k,) of q (n, N) [rad] to the nearest of the first ``count``."""
        tree = cKDTree(self._axis_times(q[:count]))
        _, near = tree.query(self._axis_times(q[own]), k=np.arange(min(NEIGHBOURS + 1, count)) + 1)
        edges = np.column_stack([near.ravel(), np.repeat(own, near.shape[1])])
        return np.asarray(edges[edges[:, 0] != edges[:, 1]])

    def _axis_times(self, q: Array) -> Array:
        """Angles (n, N) as times [s] of the axes at full speed."""
        return np.asarray(q / self.constraints.cell.robot.speed)

    def parts(self) -> np.ndarray:
        """Connected part of each pose, (n,)."""
        return np.asarray(self.graph.parts()[self.place])

    def paths(self, legs: np.ndarray) -> list[Array | None]:
        """Return a proven path (k, N) [rad] for each leg (m, 2) but its straight motion, ``None`` if there is none.

        Edges are proven along the paths that are sought alone: which states the others join is of no interest.
        """
        rounds = 200  # of proving a path's motions and seeking another
        legs = self.place[legs]
        self.graph.mark_failures(legs)
        found = self.graph.paths(legs, rounds)
        while self._bridge(legs[lost := np.flatnonzero([w is None for w in found])]):
            for k, path in zip(lost, self.graph.paths(legs[lost], rounds), strict=True):
                found[k] = path
        return [None if path is None else self.graph.q[path] for path in found]

    def _bridge(self, legs: np.ndarray) -> bool:
        """Try RRT-Connect on legs that nothing joins; what it finds joins the roadmap. Tell whether it found any."""
        tried: dict[tuple[int, int], int] = {}
        part, any_found = self.graph.number_likely_parts(), False
        for leg in legs:
            low, high = sorted(part[leg].tolist())
            if low == high or tried.get((low, high), 0) >= 3:  # legs between the same two parts that RRT-Connect tries
                continue
            tried[low, high] = tried.get((low, high), 0) + 1
            path = self._rrt(*self.graph.q[leg])
            if path is not None:
                self.graph.add_path(leg, path)
                part, any_found = self.graph.number_likely_parts(), True
                tried = {}
        return any_found

    def _rrt(self, q_from: Array, q_to: Array) -> Array | None:
        robot = self.constraints.cell.robot
        low = np.maximum(self.graph.q.min(axis=0) - BOX_MARGIN, robot.q_lower)
        high = np.minimum(self.graph.q.max(axis=0) + BOX_MARGIN, robot.q_upper)
        return rrt_connect(self.constraints, q_from, q_to, low, high, 300, self.seed)  # iterations
