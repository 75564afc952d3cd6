"""Starting a session at a later pose: proven ways from the mount pose into the path, and the stretches left out."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from planner.cell.cell import Cell
from planner.common.units import Array
from planner.motion.path.constraints import Constraints
from planner.programs.instructions import Comment, Entry, Instruction, JointMove, StretchBegin, StretchEnd
from planner.runs.run import Mounting
from planner.session.course import TimedPath
from planner.session.driven_moves import degrees, even_moves
from planner.session.tour_cost import leg_times

MANY = 120  # straight legs from the mount pose that are tried; further points are reached along the path


def prove_shortcuts(constraints: Constraints, q: Array, visit: np.ndarray) -> tuple[int, ...]:
    """Return the points of a path q (m, N) [rad], one way, that both engines join straight to its first point.

    Tried are those from which a pose is driven to, there and back: a start in the middle leads to one of them.
    """
    at = np.flatnonzero(visit >= 0)
    wanted = np.unique(np.concatenate([at - 1, at + 1]))
    wanted = wanted[(wanted > 1) & (wanted < len(q) - 1)]
    wanted = wanted[:: max(1, -(-len(wanted) // MANY))]
    if not len(wanted):
        return ()
    legs = np.stack([np.broadcast_to(q[0], (len(wanted), q.shape[1])), q[wanted]], axis=1)
    proven = constraints.prove_corners(legs).proven.copy()
    proven[proven] = constraints.judge(legs[proven]).proven
    return tuple(int(k) for k in wanted[proven])


def entry_ways(cell: Cell, mounting: Mounting, q: Array, shortcuts: Sequence[int]) -> list[list[int]]:
    """Return the quickest proven way from the first point to each point of a path q (m, N), one way, as its points.

    Its legs are legs of the path, driven either way, and the shortcuts from the first point.
    """
    m = len(q)
    a = np.concatenate([np.arange(m - 1), np.zeros(len(shortcuts), dtype=int)])
    b = np.concatenate([np.arange(1, m), np.array(shortcuts, dtype=int)])
    cost = leg_times(cell, mounting, q[a], q[b]) + 1e-3
    _, before = dijkstra(csr_array((cost, (a, b)), shape=(m, m)), directed=False, indices=0, return_predecessors=True)
    ways: list[list[int]] = []
    for point in range(m):
        way = [point]
        while way[-1] != 0:
            way.append(int(before[way[-1]]))
        ways.append(way[::-1])
    return ways


def cut_stretches(
    cell: Cell,
    mounting: Mounting,
    path: TimedPath,
    shortcuts: Sequence[int],
    written: Sequence[tuple[int, Instruction]],
    first: int,
) -> list[Instruction]:
    """Return a measuring path as stretches, one for each pose that is passed, with a way to the start of each.

    Args:
        cell, mounting: where it is driven.
        path: as driven, both ways where asked.
        shortcuts: of :func:`prove_shortcuts`.
        written: its instructions, each with the number of the path's point at which a stretch begins, or −1.
        first: number of the first start; the others count on.
    """
    m = _points_one_way(path)
    ways = entry_ways(cell, mounting, path.q[:m], shortcuts)
    legs = sorted({leg for way in ways for leg in pairwise(way)})
    ends = np.array(legs, dtype=int).ravel()  # every second of the moves between them is a leg
    moves = dict(zip(legs, even_moves(cell, path.q[ends], path.visit[ends], mounting)[::2], strict=True))
    out: list[Instruction] = [StretchBegin(first)]
    number = first - 1
    for point, item in written:
        if point >= 0:
            number += 1
            if number > first:
                there = ways[min(point, 2 * m - 2 - point)]
                way = tuple(moves[leg] for leg in pairwise(there))
                out += [StretchEnd(), Entry(number, degrees(path.q[0]), way), StretchBegin(number)]
            later = path.visit[point + 1 :]
            pose = int(later[later >= 0][0])
            if isinstance(item, JointMove) and pose != number:
                out.append(Comment(f"start {number}: pose {pose}"))
        out.append(item)
    return [*out, StretchEnd()]


def count_starts(path: TimedPath) -> int:
    """Return at how many poses a path can be started."""
    return int((path.visit[1:] >= 0).sum())


def _points_one_way(path: TimedPath) -> int:
    """Number of points up to where a path that is driven both ways turns, or of all."""
    m = (len(path.q) + 1) // 2
    returns = len(path.q) % 2 == 1 and len(path.q) > 2 and np.array_equal(path.q[:m], path.q[::-1][:m])
    return m if returns else len(path.q)
