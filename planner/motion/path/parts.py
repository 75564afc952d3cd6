"""Which valid states hang together: the connected parts of a roadmap whose edges are proven as far as that takes."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from planner.common.progress import LastStart
from planner.common.units import Array
from planner.motion.path.constraints import Constraints
from planner.motion.path.roadmap import LazyGraph, Roadmap


def connected_parts(constraints: Constraints, q: Array, seed: int = 0) -> np.ndarray:
    """Tell which connected part of the valid states each of many poses belongs to, (n,), largest part 0.

    See :class:`PartMap`.
    """
    return PartMap.of(constraints, q, seed).parts(q)


@dataclass
class PartMap:
    """The connected parts of the valid states, as a roadmap shows them; those of a start are joined to it.

    Between different parts no path was found, so a tour must keep to one of them.

    Attributes:
        roadmap: over the start, the first of its poses, and a sample of the others; it grows with the states that are
            asked for, and keeps what is proven of its edges.
        part: of each of the states that it had when these parts were found, largest part 0.
    """

    roadmap: Roadmap
    part: np.ndarray

    @classmethod
    def of(cls, constraints: Constraints, q: Array, seed: int) -> "PartMap":
        """Return the parts of valid poses (n, N) [rad], of which the first is the start and in the roadmap itself."""
        return cls._about(Roadmap.grow(constraints, q[:1], q[1:], seed))

    def begin_at(self, constraints: Constraints, start: Array) -> "PartMap":
        """Return the map with another start (N,) [rad], under constraints that allow whatever was proven under its own.

        What was proven stays so, and what failed fails.
        """
        old = self.roadmap.graph
        graph = LazyGraph(constraints, old.q, old.edges)
        graph.known[:] = old.known
        return self._about(replace(self.roadmap, constraints=constraints, graph=graph).with_poses(start[None]))

    def with_poses(self, q: Array) -> "PartMap":
        """Return the map with poses (n, N) [rad] as further states of its roadmap."""
        self.roadmap.with_poses(q)
        return self._about(self.roadmap)

    @staticmethod
    def _about(roadmap: Roadmap) -> "PartMap":
        return PartMap(roadmap, roadmap.graph.parts(LastStart.ROADMAP))

    def parts(self, q: Array) -> np.ndarray:
        """Part of each pose (n, N) [rad], (n,): that of the nearest state of the roadmap."""
        return np.asarray(self.part[self._find_nearest(q)[1]])

    def joins_start(self, q: Array) -> np.ndarray:
        """Tell which poses (n, N) [rad] lie in the part of the start, (n,) bool."""
        return np.asarray(self.parts(q) == self._part_of_start)

    def find_unjoined_poses(self, q: Array, share: float) -> np.ndarray:
        """Positions of those poses (n, N) [rad] that no proven path joins to the start; they join the roadmap."""
        place = self.roadmap.with_poses(q).place
        self.part = self.roadmap.graph.parts(share)
        return np.flatnonzero(self.part[place] != self._part_of_start)

    def are_proven(self, q: Array) -> np.ndarray:
        """Tell which poses (n, N) [rad] are states of the roadmap that a proven path joins to the start, (n,)."""
        away, nearest = self._find_nearest(q)
        return np.asarray((away == 0) & (self.part[nearest] == self._part_of_start))

    def _find_nearest(self, q: Array) -> tuple[Array, np.ndarray]:
        """Return how far the nearest state is from each pose (n, N) [rad], and which that is, of those with a part."""
        speed = self.roadmap.constraints.cell.robot.speed
        away, nearest = cKDTree(self.roadmap.graph.q[: len(self.part)] / speed).query(q / speed, workers=-1)
        return np.asarray(away), np.asarray(nearest)

    @property
    def _part_of_start(self) -> int:
        return int(self.part[self.roadmap.place[0]])
