"""How long a session takes, by the number of its poses."""

from collections.abc import Callable, Sequence

from planner.cell.cell import Cell
from planner.session.plan_types import Drive

DIMENSIONS = 6  # of joint space: the shortest tour of n points in d dimensions grows as n^(1 − 1/d)


def session_minutes(cell: Cell, drives: Sequence[Drive], poses: int) -> Callable[[int], float]:
    """Return what tells the minutes of driving of another number of poses, about, from the session that was planned.

    Each visit stands still for its dwell; the way between them grows as the shortest tour of random points does
    (Beardwood, Halton and Hammersley 1959, Math. Proc. Cambridge Phil. Soc. 55(4)).
    """
    visits = sum(len(d.visits) for d in drives)
    still = cell.motion.dwell + cell.motion.settle if cell.motion.measure == "static" else 0.0
    moving = sum(d.trajectory.duration_s for d in drives) - visits * still

    def minutes(count: int) -> float:
        other = visits - poses + count
        return float(other * still + moving * (other / visits) ** (1 - 1 / DIMENSIONS)) / 60

    return minutes
