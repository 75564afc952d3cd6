"""Comb inequalities (Groetschel and Padberg, Mathematical Programming 16, 1979) that a fractional point violates.

A handle H and an odd number k of disjoint teeth T that each cross it:  x(delta(H)) + sum x(delta(T)) >= 3k + 1.
Handles are parts held together by fractional legs, between nodes and between clusters of nodes. Teeth are pairs of
clusters with a strong link (2-matching inequalities of the contracted graph), or stretches of a good tour, chosen by
dynamic programming as in Applegate, Bixby, Chvatal and Cook, "The Traveling Salesman Problem", Princeton 2006.
"""

from collections.abc import Iterator

import numpy as np

from planner.tour.clusters import BoolArray, Clusters, links, torn
from planner.tour.inequality import VIOLATION, Cut, components, family
from planner.tour.instance import IntArray
from planner.units import Array

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
        torn_sets = clusters.sets[torn(x, clusters.sets, _CLUSTER_HANDLES)]
        combs = [_along_tour(x, handle, tour, leaving) for handle in [*handles.values(), *torn_sets]]
        violated += [comb for comb in combs if comb[0] < 1.0 - VIOLATION]
    violated.sort(key=lambda comb: comb[0])
    return [family([handle, *teeth], 3 * len(teeth) + 1) for _, handle, teeth in violated[:_COMBS]]


def _between_parts(x: Array, partition: IntArray) -> Iterator[tuple[BoolArray, Comb | None]]:
    """Yield handles of whole parts, and the comb whose teeth are pairs of parts where there is one."""
    m = len(x)
    between = links(x, partition)
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
