"""Inequalities that every tour obeys and a fractional point violates: subtours, minimum cuts and combs."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from planner.common.units import Array
from planner.motion.tour.instance import IntArray, TourInstance

BoolArray = NDArray[np.bool_]

_COARSEST = 5  # clusters in the coarsest partition
_RATIO = 1.3  # from one partition to the next finer one


@dataclass(frozen=True)
class Clusters:
    """Average-linkage clusters of the m nodes.

    Attributes:
        sets: (k, m) bool, all clusters of the tree; where there is a dummy node, each with and without it.
        partitions: (l, m) int, the cluster of each node, from coarse to fine; the dummy stands alone.

    """

    sets: BoolArray
    partitions: IntArray


def find_clusters(instance: TourInstance) -> Clusters:
    """Cluster the real nodes by their costs."""
    n = instance.n
    tree: Array = linkage(instance.cost[:n, :n][np.triu_indices(n, 1)].astype(float), "average")
    member = np.eye(n, dtype=np.bool_)
    for a, b in tree[:, :2].astype(int):
        member = np.concatenate((member, member[[a]] | member[[b]]))
    size = member.sum(axis=1)
    sets = member[(size >= 2) & (size <= n - 2)]
    steps = int(np.log(max(n / 4.0 / _COARSEST, 1.0)) / np.log(_RATIO)) + 1
    counts = np.unique(np.rint(_COARSEST * _RATIO ** np.arange(steps)).astype(int))
    partitions = np.array([fcluster(tree, count, "maxclust") for count in counts], dtype=np.int64)
    if len(instance.cost) > n:
        sets = np.concatenate([np.pad(sets, ((0, 0), (0, 1)), constant_values=dummy) for dummy in (False, True)])
        partitions = np.pad(partitions, ((0, 0), (0, 1)))
    return Clusters(sets, partitions)


def cluster_links(x: Array, partition: IntArray) -> Array:
    """Return (p, p): how strongly the parts are linked at ``x``, by number of part, 0 on the diagonal."""
    tail, head = np.nonzero(x)
    parts = int(partition.max()) + 1
    between = np.zeros((parts, parts))
    np.add.at(between, (partition[tail], partition[head]), x[tail, head])  # in order: the same on every machine
    np.fill_diagonal(between, 0.0)
    return between


def undecided_unions(x: Array, partitions: IntArray, count: int) -> list[BoolArray]:
    """Return unions of two clusters, linked by about half a leg, coarse partitions first: a leg between clusters."""
    found: dict[bytes, BoolArray] = {}
    for partition in partitions:
        between = cluster_links(x, partition)
        once = np.abs(between.sum(axis=1) - 2.0) < 0.1
        half = (np.abs(between - 0.5) < 0.3) & once[:, None] & once[None, :]
        for a, b in np.argwhere(np.triu(half)):
            union = (partition == a) | (partition == b)
            found.setdefault(union.tobytes(), union)
        if len(found) >= count:
            break
    return list(found.values())[:count]


def undecided_sets(x: Array, sets: BoolArray, count: int) -> IntArray:
    """Return which of the sets (k, m) are left between two and four times at ``x``, those nearest to three first."""
    tail, head = np.nonzero(np.triu(x, 1))
    leaving = ((sets[:, tail] != sets[:, head]) * x[tail, head]).sum(axis=1)
    off = np.round(np.abs(leaving - 3.0), 6)
    order = np.argsort(off, kind="stable")
    chosen: IntArray = order[off[order] < 0.95][:count]
    return chosen


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


def cut_from_sets(sets: list[BoolArray], rhs: int) -> Cut:
    """Return the cut of these sets (m,), each replaced by its complement if it contains node 0."""
    return Cut(np.array([~s if s[0] else s for s in sets]), rhs)


def components(linked: BoolArray) -> IntArray:
    """Return (m,): the number of the connected part that each node lies in."""
    tail, head = np.nonzero(linked)
    graph = csr_array((np.ones(len(tail)), (tail, head)), shape=linked.shape)
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


_COMBS = 30  # turned into cuts in one round
_ENOUGH = 5  # combs between parts: with so many, the dearer search along the tour can wait
_CLUSTER_HANDLES = 20
_THRESHOLDS = (1e-6, 0.1, 0.2, 0.3, 0.4)  # fractions that bind the parts of a handle

Comb = tuple[float, BoolArray, list[BoolArray]]  # left side less 3k (a tour has 1 or more), handle, teeth


def find_combs(x: Array, tour: list[int], leaving: Array, clusters: Clusters) -> list[Cut]:
    """Return the most violated combs; ``leaving`` (m, m) is x(delta) of every stretch of the tour."""
    handles: dict[bytes, BoolArray] = {}
    found: dict[bytes, Comb] = {}
    for partition in [np.arange(len(x)), *clusters.partitions]:
        for handle, comb in _between_parts(x, partition):
            handles[handle.tobytes()] = handle
            if comb is not None:
                found[b"".join(part.tobytes() for part in [comb[1], *comb[2]])] = comb
    violated = [comb for comb in found.values() if comb[0] < 1.0 - VIOLATION]
    if len(violated) < _ENOUGH:
        torn_sets = clusters.sets[undecided_sets(x, clusters.sets, _CLUSTER_HANDLES)]
        combs = [_along_tour(x, handle, tour, leaving) for handle in [*handles.values(), *torn_sets]]
        violated += [comb for comb in combs if comb[0] < 1.0 - VIOLATION]
    violated.sort(key=lambda comb: comb[0])
    return [cut_from_sets([handle, *teeth], 3 * len(teeth) + 1) for _, handle, teeth in violated[:_COMBS]]


def _between_parts(x: Array, partition: IntArray) -> Iterator[tuple[BoolArray, Comb | None]]:
    """Yield handles of whole parts, and the comb whose teeth are pairs of parts where there is one."""
    m = len(x)
    between = cluster_links(x, partition)
    seen = set()
    for threshold in _THRESHOLDS:
        label = components((between > threshold) & (between < 1.0 - threshold))
        nodes = np.bincount(label[partition])
        for number in np.flatnonzero((nodes >= 3) & (nodes <= m - 3)):
            parts = label == number
            if parts.tobytes() in seen:
                continue
            seen.add(parts.tobytes())
            handle = parts[partition]
            teeth, value = _pairs(between, parts)
            masks = [(partition == a) | (partition == b) for a, b in teeth]
            yield handle, (value, handle, masks) if len(teeth) >= 3 else None


def _pairs(between: Array, inside: BoolArray) -> tuple[list[tuple[int, int]], float]:
    """Return an odd number of disjoint pairs of parts, one inside and one not, and the comb's value with them."""
    crossing = np.where(inside[:, None] & ~inside[None, :], between, 0.0)
    leaving = between.sum(axis=1)
    first, second = np.nonzero(crossing)
    price = leaving[first] + leaving[second] - 2.0 * crossing[first, second] - 3.0
    taken = np.zeros(len(inside), dtype=np.bool_)
    teeth, prices = [], []
    for pair in np.argsort(price, kind="stable"):
        a, b = int(first[pair]), int(second[pair])
        if price[pair] >= 0.0:
            break
        if not (taken[a] or taken[b]):
            taken[a] = taken[b] = True
            teeth.append((a, b))
            prices.append(float(price[pair]))
    odd = len(teeth) - (len(teeth) + 1) % 2
    return teeth[: max(odd, 0)], float(crossing.sum()) + sum(prices[: max(odd, 0)])


def _along_tour(x: Array, handle: BoolArray, tour: list[int], leaving: Array) -> Comb:
    """Return the comb with this handle whose teeth are the best stretches of the tour."""
    turn = _quiet_place(handle[tour])
    places, turned = np.roll(tour, -turn), np.roll(leaving, (-turn, -turn), axis=(0, 1))
    stretches, saved = _best_teeth(handle[places], turned)
    teeth = []
    for first, last in stretches:
        tooth = np.zeros(len(tour), dtype=np.bool_)
        tooth[places[first : last + 1]] = True
        teeth.append(tooth)
    return float(x[handle][:, ~handle].sum()) + saved, handle, teeth


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


_STRETCHES = 40  # stretches of the tour turned into cuts in one round


def find_cuts(x: Array, tour: list[int], clusters: Clusters) -> list[Cut]:
    """Return violated cuts at the point ``x`` (m, m, degrees 2), cheapest kind first; none if none is found.

    ``tour`` is a good one; ``clusters`` of near nodes are tried as handles.
    """
    label = components(x > 1e-9)
    parts = int(label.max()) + 1
    if parts > 1:
        sets = [cut_from_sets([label == part], 2) for part in range(parts)]
        return sets[:1] if parts == 2 else sets
    leaving = _stretches(x, tour)
    cuts = _stretch_cuts(leaving, tour)
    if not cuts:
        cuts = _minimum_cuts(x)
    return cuts if len(cuts) > 3 else cuts + find_combs(x, tour, leaving, clusters)


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
    firsts = [i for i in np.argsort(value, kind="stable")[:_STRETCHES] if value[i] < 2.0 - VIOLATION]
    cuts = {}
    for first in firsts:
        chosen = np.zeros(m, dtype=np.bool_)
        chosen[tour[first : last[first] + 1]] = True
        cut = cut_from_sets([chosen], 2)
        cuts[cut.key] = cut
    return list(cuts.values())


def _minimum_cuts(x: Array) -> list[Cut]:
    """Cuts of phase below 2, after contracting legs at 1 (no minimum cut below 2 separates their ends)."""
    label = components(x > 1.0 - 1e-9)
    k = int(label.max()) + 1
    member = np.arange(k)[:, None] == label[None, :]
    tail, head = np.nonzero(x)
    weight = np.zeros((k, k))
    np.add.at(weight, (label[tail], label[head]), x[tail, head])  # not a matrix product: the same on every machine
    np.fill_diagonal(weight, 0.0)
    cuts = []
    while len(weight) > 1:
        last, before, value = _phase(weight)
        if value < 2.0 - VIOLATION:
            cuts.append(cut_from_sets([member[last]], 2))
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
