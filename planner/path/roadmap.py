"""A roadmap over poses and a pool of valid states, reused for every leg of a tour, and bridged where it falls apart."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from planner.path.constraints import Constraints
from planner.path.lazy import LazyGraph
from planner.path.ompl_search import roadmap_edges, rrt_connect
from planner.units import Array

MILESTONES = 2000  # states of the pool that a roadmap uses
NEIGHBOURS = 10
SEARCH_ROUNDS = 200
BRIDGES = 3  # legs between the same two parts that RRT-Connect tries
RRT_ITERATIONS = 300
PAD = 0.5  # [rad] by which RRT-Connect's box exceeds what the roadmap spans


@dataclass
class Roadmap:
    """OMPL's roadmap with proofs on demand.

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
        edges = roadmap_edges(states / constraints.cell.robot.speed, NEIGHBOURS, seed)
        return cls(constraints, LazyGraph(constraints, states, edges), place[: len(q)], seed)

    def parts(self) -> np.ndarray:
        """Connected part of each pose, (n,)."""
        return np.asarray(self.graph.parts()[self.place])

    def ways(self, legs: np.ndarray) -> list[Array | None]:
        """Return a proven way (k, N) [rad] for each leg (m, 2) but its straight motion, ``None`` if there is none."""
        legs = self.place[legs]
        self.graph.strike(legs)
        self._bridge(legs)
        part = self.graph.parts()
        rows = np.flatnonzero(part[legs[:, 0]] == part[legs[:, 1]])
        out: list[Array | None] = [None] * len(legs)
        for k, way in zip(rows, self.graph.ways(legs[rows], SEARCH_ROUNDS), strict=True):
            out[k] = None if way is None else self.graph.q[way]
        return out

    def _bridge(self, legs: np.ndarray) -> None:
        """Try RRT-Connect on legs between different parts of the roadmap; what it finds joins the roadmap."""
        tried: dict[tuple[int, int], int] = {}
        part = self.graph.parts()
        for leg in legs:
            low, high = sorted(part[leg].tolist())
            if low == high or tried.get((low, high), 0) >= BRIDGES:
                continue
            tried[low, high] = tried.get((low, high), 0) + 1
            way = self._rrt(*self.graph.q[leg])
            if way is not None:
                self.graph.add_way(leg, way)
                part = self.graph.parts()
                tried = {}

    def _rrt(self, q_from: Array, q_to: Array) -> Array | None:
        robot = self.constraints.cell.robot
        low = np.maximum(self.graph.q.min(axis=0) - PAD, robot.q_lower)
        high = np.minimum(self.graph.q.max(axis=0) + PAD, robot.q_upper)
        return rrt_connect(self.constraints, q_from, q_to, low, high, RRT_ITERATIONS, self.seed)


def parts(constraints: Constraints, q: Array, seed: int = 0, certain: int = 1) -> np.ndarray:
    """Tell which connected part of the valid states each of many poses belongs to, (n,), largest part 0.

    Between different parts no way was found, so a tour must keep to one of them. The parts are those of a roadmap over
    the first ``certain`` poses and a sample of the others; poses that are not in it go with the nearest that is.

    Args:
        constraints: what states and motions must keep.
        q: valid poses (n, N) [rad], those that matter most (the start) first.
        seed: of the sample.
        certain: how many of the first poses must be in the roadmap itself.
    """
    roadmap = Roadmap.grow(constraints, q[:certain], q[certain:], seed)
    part = roadmap.graph.parts()
    speed = constraints.cell.robot.speed
    _, nearest = cKDTree(roadmap.graph.q / speed).query(q / speed)
    return np.asarray(part[nearest])
