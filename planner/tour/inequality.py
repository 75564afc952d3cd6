"""Linear inequalities over families of node sets, and the graph that they are read off."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from planner.tour.clusters import BoolArray
from planner.tour.instance import IntArray

VIOLATION = 1e-3  # an inequality must be missed by this much to be worth a row


@dataclass(frozen=True)
class Cut:
    """``sum over the sets S of x(delta(S)) >= rhs``, delta(S) the legs that leave S; sets is (k, m) bool."""

    sets: BoolArray
    rhs: int

    @cached_property
    def key(self) -> bytes:
        """What tells two cuts apart."""
        return np.packbits(self.sets).tobytes()


def family(sets: list[BoolArray], rhs: int) -> Cut:
    """Return the cut of these sets (m,), each replaced by its complement if it contains node 0."""
    return Cut(np.array([~s if s[0] else s for s in sets]), rhs)


def components(linked: BoolArray) -> IntArray:
    """Return (m,): the number of the connected part that each node lies in."""
    tail, head = np.nonzero(linked)
    graph = csr_array((np.ones(len(tail)), (tail, head)), shape=linked.shape)
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
