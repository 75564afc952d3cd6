"""Iterated Lin–Kernighan search: a good tour to prove, found by seed and iteration count, never by the clock.

Lin and Kernighan, "An effective heuristic algorithm for the traveling-salesman problem", Operations Research 21
(1973), with 2-opt moves as steps; perturbed by swapping two short neighbouring segments (a local double bridge).
All costs are integers, so that the result is the same on every machine.
"""

from random import Random

import numpy as np

from planner.common.progress import UNLIMITED, LastStart, TimeLimit
from planner.common.units import IntArray


class LocalSearch:
    """Improves one closed tour over integer costs; ``tour`` is always the best found so far."""

    def __init__(
        self, cost: IntArray, neighbours: IntArray, tour: list[int], seed: int, limit: TimeLimit = UNLIMITED
    ) -> None:
        """Take costs (m, m), each node's promising neighbours (m, k), a first tour (m nodes) and a seed."""
        self._cost: list[list[int]] = cost.tolist()
        self.neighbours = neighbours
        self._size = len(tour)
        self._random, self.limit = Random(seed), limit
        self._position = [0] * self._size
        self.start_from(tour)

    def start_from(self, tour: list[int]) -> None:
        """Take another tour as the best found so far."""
        self.tour = list(tour)
        for place, node in enumerate(self.tour):
            self._position[node] = place

    def improve(self, kicks: int, most: float = np.inf) -> None:
        """Descend to a local optimum, then perturb and repair ``kicks`` times, keeping what is not worse.

        It ends once the tour is shorter by ``most``: a bound then tells that no tour is shorter still.
        """
        self._near: list[list[int]] = self.neighbours.tolist()
        gained = -self._descend(list(self.tour))
        if self._size < 8:
            return
        for _ in range(kicks):
            if gained >= most or self.limit.must_stop(
                LastStart.TOUR, "the order of the poses was searched only in part"
            ):
                break
            tour, position = self.tour.copy(), self._position.copy()
            change, ends = self._kick()
            change += self._descend(ends)
            if change > 0:
                self.tour, self._position = tour, position
            else:
                gained -= change

    def _descend(self, queue: list[int]) -> int:
        """Improve until no queued node starts a gainful chain; return the change of cost (<= 0)."""
        waiting = set(queue)
        change = 0
        while queue:
            node = queue.pop()
            waiting.discard(node)
            while True:
                gain, touched = self._chain(node)
                if gain == 0:
                    break
                change -= gain
                fresh = [other for other in touched if other not in waiting]
                waiting.update(fresh)
                queue.extend(fresh)
        return change

    def _chain(self, start: int) -> tuple[int, list[int]]:
        """Try chains of 2-opt steps from ``start`` both ways; leave the first gainful one applied."""
        for forward in (True, False):
            flips: list[tuple[int, int, int, int]] = []
            step = 1 if forward else -1
            place = (self._position[start] + step) % self._size
            gain = self._step(start, self.tour[place], (place, step), (), 0, flips)
            if gain > 0:
                for flip in flips:
                    forward = self._flip(*flip, forward)
                return gain, [node for flip in flips for node in flip]
        return 0, []

    def _step(
        self,
        t1: int,
        t2: int,
        origin: tuple[int, int],
        turned: tuple[int, ...],
        saved: int,
        flips: list[tuple[int, int, int, int]],
    ) -> int:
        """Extend the chain that removed ``saved`` net so far; return its final gain, or 0.

        Most flips would be undone at once, so none is made: seen from t1, in the direction ``step`` from where the
        chain began (``origin``), each turns round what lies before a place (``turned``).
        """
        cost, depth = self._cost, len(turned)
        options = self._extensions(t1, t2, origin, turned, saved + cost[t1][t2])
        breadth = (5, 3, 1)  # neighbours tried at the first, second and every deeper step
        for gained, t3, t4, last in options[: breadth[min(depth, 2)]]:
            flips.append((t1, t2, t3, t4))
            closed = gained - cost[t4][t1]
            if closed > 0:
                return closed
            if depth < 3:  # deeper exchanges are found step by step
                gain = self._step(t1, t4, origin, (*turned, last), closed, flips)
                if gain > 0:
                    return gain
            flips.pop()
        return 0

    def _extensions(
        self, t1: int, t2: int, origin: tuple[int, int], turned: tuple[int, ...], budget: int
    ) -> list[tuple[int, int, int, int]]:
        """Return what each step gains before it is closed, its t3 and t4, and the place of t4, best first."""
        tour, position, size, cost = self.tour, self._position, self._size, self._cost
        (begin, step), back, row = origin, turned[::-1], cost[t2]
        options: list[tuple[int, int, int, int]] = []
        for t3 in self._near[t2]:
            left = budget - row[t3]
            if left <= 0 or t3 == t1:
                continue
            place = step * (position[t3] - begin) % size
            for last in turned:
                if place <= last:
                    place = last - place
            if place > 1:  # else t4 is t2
                before = place - 1
                for last in back:
                    if before <= last:
                        before = last - before
                t4 = tour[(begin + step * before) % size]
                options.append((left + cost[t3][t4], t3, t4, place - 1))
        options.sort(reverse=True)
        return options

    def _flip(self, t1: int, t2: int, t3: int, t4: int, forward: bool) -> bool:
        """Replace legs t1-t2 and t3-t4 by t2-t3 and t4-t1; return whether t4 now follows t1."""
        first, last = (self._position[t2], self._position[t4]) if forward else (self._position[t4], self._position[t2])
        size = self._size
        inside = (last - first) % size + 1
        mirrored = 2 * inside > size
        if mirrored:
            first, last = (last + 1) % size, (first - 1) % size
        self._reverse(first, last)
        return forward != mirrored

    def _reverse(self, first: int, last: int) -> None:
        tour, position = self.tour, self._position
        if first <= last:
            piece = tour[first : last + 1]
            piece.reverse()
            tour[first : last + 1] = piece
            for place, node in enumerate(piece, first):
                position[node] = place
            return
        piece = tour[first:] + tour[: last + 1]
        piece.reverse()
        head = self._size - first
        tour[first:], tour[: last + 1] = piece[:head], piece[head:]
        for place, node in enumerate(piece, first - self._size):
            position[node] = place if place >= 0 else place + self._size

    def _kick(self) -> tuple[int, list[int]]:
        """Swap two short neighbouring segments somewhere; return the change of cost and the touched nodes."""
        size, tour, cost = self._size, self.tour, self._cost
        longest = max(1, min(30, (size - 2) // 3))  # nodes of the longest segment that a perturbation swaps
        draw = self._random.random
        start, one, two = int(draw() * size), 1 + int(draw() * longest), 1 + int(draw() * longest)
        places = [(start + step) % size for step in range(one + two + 2)]
        nodes = [tour[place] for place in places]
        a, b, c, d, e, f = nodes[0], nodes[1], nodes[one], nodes[one + 1], nodes[one + two], nodes[-1]
        for place, node in zip(places[1:-1], nodes[one + 1 : -1] + nodes[1 : one + 1], strict=True):
            tour[place] = node
            self._position[node] = place
        change = cost[a][d] + cost[e][b] + cost[c][f] - cost[a][b] - cost[c][d] - cost[e][f]
        return change, list(dict.fromkeys((a, b, c, d, e, f)))


def nearest_neighbours(weight: np.ndarray, count: int) -> IntArray:
    """Return the ``count`` nodes of least weight from each node, nearest first, ties by number: (m, count)."""
    masked = np.asarray(weight, dtype=float).copy()
    np.fill_diagonal(masked, np.inf)
    order = np.argsort(masked, axis=1, kind="stable")
    return order[:, : min(count, len(masked) - 1)].astype(np.int64)


def greedy_tour(cost: IntArray) -> list[int]:
    """Return a closed tour made of the cheapest legs that close no circle early, ties by number."""
    m = len(cost)
    tail, head = np.triu_indices(m, 1)
    near: list[list[int]] = [[] for _ in range(m)]
    group = list(range(m))  # the other end of the path that a node ends
    left = m - 1
    for leg in np.argsort(cost[tail, head], kind="stable"):
        a, b = int(tail[leg]), int(head[leg])
        if len(near[a]) < 2 and len(near[b]) < 2 and group[a] != b:
            near[a].append(b)
            near[b].append(a)
            ends = group[a], group[b]
            group[ends[0]], group[ends[1]] = ends[1], ends[0]
            left -= 1
            if left == 0:
                break
    return walk_tour(near, next(node for node in range(m) if len(near[node]) == 1))


def walk_tour(near: list[list[int]], start: int) -> list[int]:
    """Return the nodes in the order in which one comes by them from ``start`` on, given the neighbours of each."""
    tour, before = [start], -1
    while len(tour) < len(near):
        before, here = tour[-1], next(node for node in near[tour[-1]] if node != before)
        tour.append(here)
    return tour
