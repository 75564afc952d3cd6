"""Shortest proven ways through graphs whose edges are proven only when a way wants them (lazy roadmaps).

Bohlin and Kavraki, "Path planning using lazy PRM", ICRA 2000: search as if every edge were good, prove the edges
of the way found, strike out those that fail, search again. All ways that are wanted at once are searched and
proven together.
"""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from planner.path.constraints import Constraints
from planner.units import Array

UNKNOWN, PROVEN, BROKEN = 0, 1, 2
SUPPORT_COST = 0.1  # [s] what a support pose costs beyond its way: each is a corner to blend


def leg_time(constraints: Constraints, q_from: Array, q_to: Array) -> Array:
    """Time of the slowest axis at full speed (EDBB paper, eq. 7), with a little of all axes to break ties, (n,) [s]."""
    share = np.abs(q_to - q_from) / constraints.cell.robot.speed
    return np.asarray(share.max(axis=1) + 0.02 * share.sum(axis=1))


class LazyGraph:
    """States and the edges that may join them.

    Args:
        constraints: what edges must keep.
        q: states (V, N) [rad].
        edges: (E, 2) positions in ``q``; each edge once.
    """

    def __init__(self, constraints: Constraints, q: Array, edges: np.ndarray) -> None:
        self.constraints, self.q = constraints, q
        self.edges = np.unique(np.sort(edges, axis=1), axis=0)
        self.cost = leg_time(constraints, *q[self.edges.T]) + SUPPORT_COST
        self.known = np.full(len(self.edges), UNKNOWN)
        self._key = self.edges[:, 0] * len(q) + self.edges[:, 1]

    def add_way(self, ends: np.ndarray, way: Array) -> None:
        """Add a proven way (k, N) [rad] between two states that the graph has."""
        inner = len(self.q) + np.arange(len(way) - 2)
        chain = np.concatenate([ends[:1], inner, ends[1:]])
        new = np.column_stack([chain[:-1], chain[1:]])
        grown = LazyGraph(self.constraints, np.concatenate([self.q, way[1:-1]]), np.concatenate([self.edges, new]))
        grown.known[grown._rows(self.edges)] = self.known
        grown.known[grown._rows(new)] = PROVEN
        self.__dict__.update(grown.__dict__)

    def strike(self, edges: np.ndarray) -> None:
        """Mark edges (n, 2) that are known to fail; those not in the graph are passed over."""
        self.known[self._rows(edges)] = BROKEN

    def ways(self, wanted: np.ndarray, rounds: int) -> list[list[int] | None]:
        """Return the shortest proven way for each wanted (from, to) (m, 2), ``None`` where there is none.

        Args:
            wanted: positions of the states to join.
            rounds: searches at most; ways not proven by then are ``None``.
        """
        found: list[list[int] | None] = [None] * len(wanted)
        open_ = list(range(len(wanted)))
        for _ in range(rounds):
            if not open_:
                break
            ways = self._search(wanted[open_])
            asked = [self._rows(np.column_stack([w[:-1], w[1:]])) if w else np.zeros(0, int) for w in ways]
            self._prove(np.unique(np.concatenate([np.zeros(0, int), *asked])))
            later = []
            for k, way, rows in zip(open_, ways, asked, strict=True):
                if way and (self.known[rows] == PROVEN).all():
                    found[k] = way
                elif way:
                    later.append(k)
            open_ = later
        return found

    def parts(self) -> np.ndarray:
        """Number of the connected part of each state, (V,), largest part 0; proves no more edges than that takes."""
        while True:
            part = self._parts(self.known == PROVEN)
            a, b = part[self.edges].T
            rows = np.flatnonzero((self.known == UNKNOWN) & (a != b))
            if len(rows) == 0:
                return part
            self._prove(_cheapest(rows, part[self.edges[rows]], self.cost[rows], np.bincount(part)))

    def _parts(self, good: np.ndarray) -> np.ndarray:
        a, b = self.edges[good].T
        graph = csr_array((np.ones(len(a)), (a, b)), shape=(len(self.q),) * 2)
        part = connected_components(graph, directed=False)[1]
        rank = np.empty(part.max() + 1, dtype=int)
        rank[np.argsort(-np.bincount(part), kind="stable")] = np.arange(part.max() + 1)
        return np.asarray(rank[part])

    def _search(self, wanted: np.ndarray) -> list[list[int] | None]:
        good = self.known != BROKEN
        a, b = self.edges[good].T
        graph = csr_array((self.cost[good], (a, b)), shape=(len(self.q),) * 2)
        sources, row = np.unique(wanted[:, 0], return_inverse=True)
        _, before = dijkstra(graph, directed=False, indices=sources, return_predecessors=True)
        return [_trace(before[r], int(goal)) for r, goal in zip(row, wanted[:, 1], strict=True)]

    def _prove(self, rows: np.ndarray) -> None:
        rows = rows[self.known[rows] == UNKNOWN]
        if len(rows):
            a, b = self.edges[rows].T
            self.known[rows] = np.where(self.constraints.prove(self.q[a], self.q[b]).proven, PROVEN, BROKEN)

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


def _trace(before: np.ndarray, goal: int) -> list[int] | None:
    """Follow the predecessors back from ``goal``."""
    if before[goal] < 0:
        return None
    way = [goal]
    while before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    return way[::-1]
