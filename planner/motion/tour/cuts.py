"""Inequalities that every tour keeps and points of a relaxation violate: subtours and blossoms."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from planner.common.units import Array, IntArray

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Cut:
    """An inequality over the legs that leave a node set.

    A tour leaves it at least twice. It leaves it an even number of times, too, so that of an odd number of these legs
    (``teeth``) it leaves at least one out, or takes at least one of the others: the blossoms of Edmonds, Journal of
    Research of the National Bureau of Standards 69B (1965).

    Attributes:
        side: the node set, (m,), node 0 outside.
        teeth: legs that leave it (t, 2), the smaller node first, an odd number; none for a subtour inequality.
    """

    side: BoolArray
    teeth: IntArray

    @classmethod
    def of(cls, side: BoolArray, teeth: IntArray | None = None) -> "Cut":
        """Return the cut of a node set or of the nodes outside it: both are the same."""
        return cls(~side if side[0] else side, np.zeros((0, 2), dtype=np.int64) if teeth is None else teeth)

    @property
    def least(self) -> int:
        """Smallest sum of the legs' use, each by its factor."""
        return 1 - len(self.teeth) if len(self.teeth) else 2

    @cached_property
    def key(self) -> bytes:
        """The same for the same inequality alone."""
        return self.side.tobytes() + self.teeth.tobytes()

    def factors(self, legs: IntArray) -> Array:
        """Return the factors of legs (k, 2), the smaller node first: 1 where they leave the set, −1 of teeth, (k,)."""
        size = len(self.side)
        out: Array = (self.side[legs[:, 0]] != self.side[legs[:, 1]]).astype(float)
        out[np.isin(legs @ (size, 1), self.teeth @ (size, 1))] = -1.0
        return out


def violated_sets(x: Array) -> list[BoolArray]:
    """Return node sets that ``x`` (m, m, degrees 2) leaves less than twice: unconnected parts, or minimum cuts.

    Stoer and Wagner, J. ACM 44 (1997), after contracting legs at 1: no cut below 2 separates their ends.
    """
    parts = connected_sets(x > 1e-9)
    if len(parts) > 1:
        return parts
    member = np.array(connected_sets(x > 1.0 - 1e-9))
    label = member.argmax(axis=0)
    tail, head = np.nonzero(x)
    weight = np.zeros((len(member), len(member)))
    np.add.at(weight, (label[tail], label[head]), x[tail, head])  # not a matrix product: the same on every machine
    np.fill_diagonal(weight, 0.0)
    found = []
    missed = 1e-3  # by which an inequality must be missed to be worth a row
    while len(weight) > 1:
        last, before, value = _cut_of_phase(weight)
        if value < 2.0 - missed:
            found.append(member[last])
        weight[before] += weight[last]
        weight[:, before] += weight[:, last]
        weight[before, before] = 0.0
        member[before] |= member[last]
        keep = np.arange(len(weight)) != last
        weight, member = weight[np.ix_(keep, keep)], member[keep]
    return found


def _cut_of_phase(weight: Array) -> tuple[int, int, float]:
    """Maximum adjacency order from node 0: its last node, the one before, and the cut around the last."""
    attached = weight[0].copy()
    attached[0] = -np.inf
    last, before, value = 0, 0, 0.0
    for _ in range(len(weight) - 1):
        before, last = last, int(attached.argmax())
        value = float(attached[last])
        attached += weight[last]
        attached[last] = -np.inf
    return last, before, value


def violated_blossoms(x: Array) -> list[Cut]:
    """Return blossoms that ``x`` (m, m, degrees 2, no subtour violated) misses, not all of them.

    Looked at are the parts that legs hold together whose use is nowhere near 0 or 1 (Padberg and Hong, Mathematical
    Programming Study 12, 1980). Trees of minimum cuts would find all: in ten times
    the time, a tenth more of the gap is closed.
    """
    lacks = np.minimum(x, 1.0 - x)
    # 1e-6, 0.1 …: what a leg lacks at least to hold two nodes together
    return _blossoms(x, [part for least in (1e-6, 0.1, 0.2, 0.3, 0.4) for part in connected_sets(lacks > least)])


def _blossoms(x: Array, sides: list[BoolArray]) -> list[Cut]:
    """Return for each of the node sets (m,) the blossom that ``x`` misses by most, if it misses one."""
    sides = [side for side in sides if np.count_nonzero(side) > 1]
    if not sides:
        return []
    tail, head = np.nonzero(np.triu(x > 0.0, 1))
    use, handles = x[tail, head], np.array(sides)
    leaves = handles[:, tail] != handles[:, head]  # (sets, legs)
    tooth = leaves & (use > 0.5)
    kept = (leaves * np.minimum(use, 1.0 - use)).sum(axis=1)
    # where the number is even, the leg that is nearest to either changes over
    even = np.flatnonzero(np.count_nonzero(tooth, axis=1) % 2 == 0)
    between = np.where(leaves[even], np.abs(1.0 - 2.0 * use), np.inf)
    nearest = between.argmin(axis=1)
    kept[even] += between.min(axis=1)
    tooth[even, nearest] ^= True
    legs = np.column_stack([tail, head])  # 1e-3: as of subtours
    return [Cut.of(sides[k], legs[tooth[k]]) for k in np.flatnonzero(kept < 1.0 - 1e-3)]


def connected_sets(linked: BoolArray) -> list[BoolArray]:
    """Return the connected parts of the graph as node sets (m,)."""
    count, label = connected_components(csr_array(linked), directed=False)
    return [label == k for k in range(count)]
