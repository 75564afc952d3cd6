"""Exact dynamic programming for a few nodes (Held and Karp, J. SIAM 10, 1962), on the costs as they are."""

import numpy as np

from planner.units import Array


def shortest_order(cost_s: Array, start: int | None, end: int | None) -> tuple[list[int], float]:
    """Return the best order of all n nodes and its cost [s]; infinite where forbidden legs leave none.

    ``cost_s`` is (n, n), forbidden legs infinite; equal ends close the tour, None leaves an end free.
    """
    n = len(cost_s)
    best = np.full((2**n, n), np.inf)
    for node in range(n) if start is None else [start]:
        best[1 << node, node] = 0.0
    for visited in range(1, 2**n):
        if not np.isfinite(best[visited]).any():
            continue
        arrival = (best[visited][:, None] + cost_s).min(axis=0)
        for node in range(n):
            if not visited >> node & 1:
                best[visited | 1 << node, node] = arrival[node]
    closing = np.zeros(n)
    if end is not None:
        closing = cost_s[:, end].copy() if start == end else np.where(np.arange(n) == end, 0.0, np.inf)
    if n == 1:
        closing[:] = 0.0
    visited, total = 2**n - 1, best[-1] + closing
    order = [int(total.argmin())]
    while len(order) < n:
        before = visited & ~(1 << order[-1])
        order.append(int((best[before] + cost_s[:, order[-1]]).argmin()))
        visited = before
    return order[::-1], float(total.min())
