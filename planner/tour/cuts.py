"""Separation: inequalities that every tour obeys and a fractional point does not, cheapest kind first.

Subtour elimination for unconnected parts, for stretches of a good tour, and for whole minimum cuts (Stoer and
Wagner, J. ACM 44, 1997); combs when few of those are missing.
"""

import numpy as np

from planner.tour.clusters import Clusters
from planner.tour.combs import find_combs
from planner.tour.inequality import VIOLATION, Cut, components, family
from planner.units import Array

_STRETCHES = 40  # stretches of the tour turned into cuts in one round


def separate(x: Array, tour: list[int], clusters: Clusters) -> list[Cut]:
    """Return violated cuts at the point ``x`` (m, m, degrees 2), cheapest kind first; none if none is found.

    ``tour`` is a good one; ``clusters`` of near nodes are tried as handles.
    """
    label = components(x > 1e-9)
    parts = int(label.max()) + 1
    if parts > 1:
        sets = [family([label == part], 2) for part in range(parts)]
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
        cut = family([chosen], 2)
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
