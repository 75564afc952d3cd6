"""Time of a leg by its slowest limit: what a tour costs, how long a session takes, the quickest ways to its starts."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from planner.cell.cell import Cell
from planner.common.units import Array
from planner.motion.path.constraints import Constraints
from planner.motion.timing.leg_times import axis_times, limit_times, tool_speed
from planner.programs.instructions import Comment, Entry, Instruction, JointMove, StretchBegin, StretchEnd
from planner.runs.run import Mounting
from planner.session.driven_moves import degrees, even_moves
from planner.session.plan_types import Drive, TimedPath


def leg_times(cell: Cell, mounting: Mounting, start: Array, end: Array) -> Array:
    """Return the time of straight joint legs (m, N) [rad] with the gauge attached, (m,) [s], as a tour counts it.

    By the slowest of all limits. Where the cell asks for ``order = "slowest-axis"``, it is that of the slowest axis at
    full speed alone (EDBB paper, eq. 7).
    """
    if cell.motion.order == "slowest-axis":
        return axis_times(start, end, cell.robot.speed)
    return limit_times(cell, mounting, start, end)


def tour_costs(cell: Cell, mounting: Mounting, nodes: Array) -> Array:
    """Return the cost of the leg between any two of the nodes (n, N) [rad], (n, n) [s], the same both ways."""
    a, b = np.triu_indices(len(nodes), 1)
    cost = np.zeros((len(nodes), len(nodes)))
    cost[a, b] = cost[b, a] = leg_times(cell, mounting, nodes[a], nodes[b])
    return cost


def cost_name(cell: Cell) -> str:
    """Say what the tour is the shortest of."""
    if cell.motion.order == "slowest-axis":
        return "slowest axis at full speed"
    limited = np.isfinite(tool_speed(cell, bar=True))
    return "slowest of axes, tool speed and gauge rate" if limited else "slowest axis at the speed allowed"


def session_minutes(cell: Cell, drives: Sequence[Drive], poses: int) -> Callable[[int], float]:
    """Return a function that estimates the driving minutes of another number of poses from the planned session.

    At each visit the robot rests; the way between them grows as the shortest tour of random points does
    (Beardwood, Halton and Hammersley 1959, Math. Proc. Cambridge Phil. Soc. 55(4)).
    """
    visits = sum(len(d.visits) for d in drives)
    still = cell.rest_seconds
    moving = sum(d.trajectory.duration_s for d in drives) - visits * still

    def minutes(count: int) -> float:
        """Return the minutes that so many poses take."""
        other = visits - poses + count
        # 6: dimensions: the shortest tour of n points in d dimensions grows as n^(1 - 1/d), d = 6
        return float(other * still + moving * (other / visits) ** (1 - 1 / 6)) / 60

    return minutes


def prove_shortcuts(constraints: Constraints, q: Array, visit: np.ndarray) -> tuple[int, ...]:
    """Return which points of a path q (m, N) [rad] both engines prove to be joined straight to its first point.

    Tried are those from which a pose is driven to, there and back: a start in the middle leads to one of them.
    """
    at = np.flatnonzero(visit >= 0)
    wanted = np.unique(np.concatenate([at - 1, at + 1]))
    wanted = wanted[(wanted > 1) & (wanted < len(q) - 1)]
    # 120: straight legs from the mount pose are tried; further points are reached along the path
    wanted = wanted[:: max(1, -(-len(wanted) // 120))]
    if not len(wanted):
        return ()
    legs = np.stack([np.broadcast_to(q[0], (len(wanted), q.shape[1])), q[wanted]], axis=1)
    return tuple(int(k) for k in wanted[constraints.prove_by_both_engines(legs)])


def entry_paths(cell: Cell, mounting: Mounting, q: Array, shortcuts: Sequence[int]) -> list[list[int]]:
    """Return for each point of a path q (m, N) the quickest proven way to it from the first, as points passed.

    Its legs are legs of the path, driven either way, and the shortcuts from the first point. Where the path comes to a
    point again, from a ball that it has touched, that counts as one point: no way leads over the ball.
    """
    m = len(q)
    _, first, again = np.unique(q, axis=0, return_index=True, return_inverse=True)
    same = first[again.ravel()]
    a = np.concatenate([same[:-1], np.zeros(len(shortcuts), dtype=int)])
    b = np.concatenate([same[1:], same[np.array(shortcuts, dtype=int)]])
    a, b = np.unique(np.sort(np.column_stack([a, b])[a != b], axis=1), axis=0).T
    cost = leg_times(cell, mounting, q[a], q[b]) + 1e-3
    _, before = dijkstra(csr_array((cost, (a, b)), shape=(m, m)), directed=False, indices=0, return_predecessors=True)
    ways: list[list[int]] = []
    for point in range(m):
        way = [int(same[point])]
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
    """Return a measuring path as stretches, one for each pose that is passed, with a path to the start of each.

    Args:
        cell, mounting: where it is driven.
        path: as driven, both ways where asked.
        shortcuts: of :func:`prove_shortcuts`.
        written: its instructions, each with the number of the path's point at which a stretch begins, or −1.
        first: number of the first start; the others count on.
    """
    m = path.one_way
    ways = entry_paths(cell, mounting, path.q[:m], shortcuts)
    legs = sorted({leg for way in ways for leg in pairwise(way)})
    ends = np.array(legs, dtype=int).ravel()  # every second of the moves between them is a leg
    moves = dict(zip(legs, even_moves(cell, path.q[ends], path.visit[ends], mounting)[::2], strict=True))
    out: list[Instruction] = [StretchBegin(first)]
    number, here = first - 1, degrees(path.q[0])
    for point, item in written:
        if point >= 0:
            number += 1
            if number > first:
                there = ways[min(point, 2 * m - 2 - point)]
                way = tuple(moves[leg] for leg in pairwise(there)) + _to_step(cell, mounting, path.q[point], here)
                entry = [Entry(number, degrees(path.q[0]), way)] if way else []  # the robot stands there already
                out += [StretchEnd(), *entry, StretchBegin(number)]
            later = path.visit[point + 1 :]
            pose = int(later[later >= 0][0])
            if isinstance(item, JointMove) and pose != number:
                out.append(Comment(f"start {number}: pose {pose}"))
        out.append(item)
        here = item.q_deg if isinstance(item, JointMove) else here
    return [*out, StretchEnd()]


def _to_step(cell: Cell, mounting: Mounting, q: Array, here: tuple[float, ...]) -> tuple[JointMove, ...]:
    """Lead from a corner q (N,) [rad] to where a path in small steps, which cuts it, goes on."""
    # 1e-9: [deg] between a corner of the path and the step that a start goes on with
    if np.abs(np.subtract(np.rad2deg(q), here)).max() <= 1e-9:
        return ()
    return tuple(even_moves(cell, np.stack([q, np.deg2rad(here)]), np.array([-1, -1]), mounting))
