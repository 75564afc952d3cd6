"""Inequalities that every tour obeys and a fractional point may not: subtour elimination and comb inequalities.

A cut is a family of node sets S with  sum_S x(delta(S)) >= rhs, delta(S) the legs that leave S. One set and 2 is
subtour elimination; a handle and k (odd) disjoint teeth that each cross it, and 3k + 1, is a comb (Groetschel and
Padberg 1979). Teeth are sought among the stretches of a good tour by dynamic programming, as in Applegate, Bixby,
Chvatal and Cook, "The Traveling Salesman Problem", Princeton 2006, chapter 7; whole subtours by Stoer and Wagner's
minimum cut (J. ACM 44, 1997).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from planner.tour.clusters import BoolArray, Clusters, torn
from planner.tour.instance import IntArray
from planner.units import Array

_VIOLATION = 1e-3  # a cut must be missed by this much to be worth a row
_STRETCHES = 40  # stretches of the tour turned into cuts in one round
_COMBS = 30
_CLUSTER_HANDLES = 20
_THRESHOLDS = (1e-6, 0.1, 0.2, 0.3, 0.4)  # fractions that bind the nodes of a handle


@dataclass(frozen=True)
class Cut:
    """``sum over the sets S of x(delta(S)) >= rhs``; sets is (k, m) bool."""

    sets: BoolArray
    rhs: int

    @cached_property
    def key(self) -> bytes:
        """What tells two cuts apart."""
        return np.packbits(self.sets).tobytes()


def family(sets: list[BoolArray], rhs: int) -> Cut:
    """Return the cut of these sets (m,), each replaced by its complement if it contains node 0."""
    return Cut(np.array([~s if s[0] else s for s in sets]), rhs)


def separate(x: Array, tour: list[int], clusters: Clusters) -> list[Cut]:
    """Return violated cuts at the point ``x`` (m, m, degrees 2), cheapest kind first; none if none is found.

    ``tour`` is a good one; ``clusters`` of near nodes are tried as handles.
    """
    label = _components(x > 1e-9)
    parts = int(label.max()) + 1
    if parts > 1:
        sets = [family([label == part], 2) for part in range(parts)]
        return sets[:1] if parts == 2 else sets
    leaving = _stretches(x, tour)
    cuts = _stretch_cuts(leaving, tour)
    if not cuts:
        cuts = _minimum_cuts(x)
    return cuts if len(cuts) > 3 else cuts + _combs(x, tour, leaving, clusters)


def _components(linked: BoolArray) -> IntArray:
    """Return (m,): the number of the connected part that each node lies in."""
    tail, head = np.nonzero(linked)
    graph = csr_array((np.ones(len(tail)), (tail, head)), shape=linked.shape)
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _stretches(x: Array, tour: list[int]) -> Array:
    """Return (m, m): x(delta(S)) of the stretch of the tour from place i on to place j, past the end if j < i."""
    m = len(tour)
    total = np.zeros((m + 1, m + 1))
    total[1:, 1:] = x[np.ix_(tour, tour)].cumsum(axis=0).cumsum(axis=1)
    square = total.diagonal()
    inside = square[None, 1:] - total[:-1, 1:] - total[1:, :-1].T + square[:-1, None]  # each leg counted twice
    count = np.arange(m)[None, :] - np.arange(m)[:, None] + 1
    leaving = np.where((count >= 1) & (count < m), 2.0 * count - inside, np.inf)
    leaving[2:, :-2] = np.where(count[2:, :-2] < 0, leaving[1:-1, 1:-1].T, leaving[2:, :-2])  # complements
    return leaving


def _stretch_cuts(leaving: Array, tour: list[int]) -> list[Cut]:
    m = len(tour)
    last = np.argmin(np.triu(leaving) + np.tri(m, k=-1) * 4.0, axis=1)
    value = leaving[np.arange(m), last]
    firsts = [i for i in np.argsort(value, kind="stable")[:_STRETCHES] if value[i] < 2.0 - _VIOLATION]
    cuts = {}
    for first in firsts:
        chosen = np.zeros(m, dtype=np.bool_)
        chosen[tour[first : last[first] + 1]] = True
        cut = family([chosen], 2)
        cuts[cut.key] = cut
    return list(cuts.values())


def _minimum_cuts(x: Array) -> list[Cut]:
    """Cuts of phase below 2, after contracting legs at 1 (no minimum cut below 2 separates their ends)."""
    label = _components(x > 1.0 - 1e-9)
    k = int(label.max()) + 1
    member = np.arange(k)[:, None] == label[None, :]
    tail, head = np.nonzero(x)
    weight = np.zeros((k, k))
    np.add.at(weight, (label[tail], label[head]), x[tail, head])  # not a matrix product: the same on every machine
    np.fill_diagonal(weight, 0.0)
    cuts = []
    while len(weight) > 1:
        last, before, value = _phase(weight)
        if value < 2.0 - _VIOLATION:
            cuts.append(family([member[last]], 2))
        weight[before] += weight[last]
        weight[:, before] += weight[:, last]
        weight[before, before] = 0.0
        member[before] |= member[last]
        keep = np.arange(len(weight)) != last
        weight, member = weight[np.ix_(keep, keep)], member[keep]
    return cuts


def _phase(weight: Array) -> tuple[int, int, float]:
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


def _handles(x: Array, clusters: Clusters) -> list[BoolArray]:
    """Parts held together by fractional legs, between nodes and between the clusters of each partition."""
    m = len(x)
    found: dict[bytes, BoolArray] = {}
    tail, head = np.nonzero(x)
    for partition in [np.arange(m), *clusters.partitions]:
        between = np.zeros((m, m))
        np.add.at(between, (partition[tail], partition[head]), x[tail, head])
        for threshold in _THRESHOLDS:
            label = _components((between > threshold) & (between < 1.0 - threshold))[partition]
            for part in np.unique(label):
                handle = label == part
                if 3 <= handle.sum() <= m - 3:
                    found[handle.tobytes()] = handle
    torn_sets = clusters.sets[torn(x, clusters.sets, _CLUSTER_HANDLES)]
    return [*found.values(), *torn_sets]


def _combs(x: Array, tour: list[int], leaving: Array, clusters: Clusters) -> list[Cut]:
    scored = []
    for handle in _handles(x, clusters):
        turn = _quiet_place(handle[tour])
        places, turned = np.roll(tour, -turn), np.roll(leaving, (-turn, -turn), axis=(0, 1))
        boundary = float(x[handle][:, ~handle].sum())
        teeth, saved = _best_teeth(handle[places], turned)
        if boundary + saved < 1.0 - _VIOLATION:
            scored.append((boundary + saved, handle, [places[first : last + 1] for first, last in teeth]))
    scored.sort(key=lambda item: item[0])
    cuts = []
    for _, handle, teeth in scored[:_COMBS]:
        sets = [handle]
        for nodes in teeth:
            tooth = np.zeros(len(tour), dtype=np.bool_)
            tooth[nodes] = True
            sets.append(tooth)
        cuts.append(family(sets, 3 * len(teeth) + 1))
    return cuts


def _quiet_place(inside: BoolArray) -> int:
    """Return the middle of the longest run in or out of the handle: a stretch across it would make a poor tooth."""
    changes = np.flatnonzero(inside != np.roll(inside, 1))
    runs = np.diff(changes, append=changes[0] + len(inside))
    longest = int(runs.argmax())
    return int((changes[longest] + runs[longest] // 2) % len(inside))


def _best_teeth(inside: BoolArray, leaving: Array) -> tuple[list[tuple[int, int]], float]:
    """Return an odd number of disjoint stretches that cross the handle, of least sum of x(delta) - 3."""
    m = len(inside)
    before = np.concatenate(([0], np.cumsum(inside)))
    held = before[None, 1:] - before[:-1, None]
    length = np.arange(m)[None, :] - np.arange(m)[:, None] + 1
    price = np.where((length > 0) & (held > 0) & (held < length) & (leaving < 3.0), leaving - 3.0, np.inf)
    best = np.full((2, m + 1), np.inf)
    best[0, 0] = 0.0
    choice: IntArray = np.full((2, m + 1), -1, dtype=np.int64)
    useful: BoolArray = np.asarray(np.isfinite(price).any(axis=0))
    for last in range(m):
        best[:, last + 1] = best[:, last]
        if useful[last]:
            totals = best[::-1, : last + 1] + price[: last + 1, last]
            first = totals.argmin(axis=1)
            for odd in (0, 1):
                if totals[odd, first[odd]] < best[odd, last + 1] - 1e-12:
                    best[odd, last + 1] = totals[odd, first[odd]]
                    choice[odd, last + 1] = first[odd]
    teeth, odd, end = [], 1, m
    while end > 0 and np.isfinite(best[1, m]):
        first = int(choice[odd, end])
        if first >= 0:
            teeth.append((first, end - 1))
            end, odd = first, 1 - odd
        else:
            end -= 1
    return teeth, float(best[1, m])
