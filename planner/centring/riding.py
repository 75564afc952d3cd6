"""How the robot comes to the balls: the planner drives it along the planned way, or it follows the robot's own program.

Both hand over each pose that is left when the head stands on its ball, and go on when they are asked for the next.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from planner.centring.bench import Bench, Session
from planner.centring.course import Visit, Way
from planner.centring.errors import LinkError
from planner.centring.resting import at_rest
from planner.centring.safeguards import check_free
from planner.units import to_deg


def driven(session: Session, bench: Bench) -> Iterator[Visit]:
    """Drive the planned way, backward where that is where the rest lies, and end at its end.

    Raises:
        LinkError: the robot stands off the way, or does not move.
        ContactError: an indicator is stuck before it touches.
    """
    way, settings = session.way, bench.settings
    at = _start(way, bench)
    for visit in session.pending:
        bench.place.text = _named(visit)
        off_ball = way.before(visit, at)
        _drive(way.between(at, off_ball), way, bench)
        if settings.head.check_free:
            check_free(at_rest(bench.indicators, settings.rest, bench.stop), settings.head)
        _drive([off_ball, visit.at], way, bench)
        at = visit.at
        yield visit
    bench.place.text = "on the way back"
    _drive(way.between(at, len(way.q) - 1), way, bench)


def followed(session: Session, bench: Bench) -> Iterator[Visit]:
    """Wait for the plan's own program to come to its balls; those that are measured are left at once.

    Raises:
        LinkError: the program does not come, or is another plan's.
    """
    visits = {v.id: v for v in session.way.visits}
    while session.pending:
        bench.place.text = "waiting for the robot's program"
        pose = bench.link.arrive()
        visit = visits.get(pose)
        if visit is None:
            raise LinkError(f"the robot's program is at pose {pose}, which this plan has not: is it another's?")
        bench.place.text = _named(visit)
        off = float(np.abs(to_deg(bench.link.joints()[1] - session.way.q[visit.at])).max())
        if off > bench.settings.robot.arrived_deg:
            raise LinkError(
                f"the robot's program stands {off:.3f} deg away from pose {pose} of this plan: is it another's?"
            )
        if visit.id not in session.journal.measured:
            yield visit
        bench.link.release()


def _start(way: Way, bench: Bench) -> int:
    """Bring the robot to the point of the way that is nearest, and return that.

    Raises:
        LinkError: it stands elsewhere; the way from there is not known to be free.
    """
    at, off = way.nearest(bench.link.joints()[1])
    if float(to_deg(off)) > bench.settings.robot.start_deg:
        first = ", ".join(f"{a:.2f}" for a in to_deg(way.q[0]))
        raise LinkError(
            f"the robot stands {float(to_deg(off)):.1f} deg away from the planned path, and the way to it was never "
            f"checked; take it by hand to the start of the path ({first} deg)"
        )
    bench.link.move(way.q[at], slow=True)
    return at


def _drive(points: list[int], way: Way, bench: Bench) -> None:
    """Drive from the first of the points on; slowly where one end of a leg is a ball."""
    balls = {v.at for v in way.visits}
    for before, point in pairwise(points):
        bench.link.move(way.q[point], slow=before in balls or point in balls)


def _named(visit: Visit) -> str:
    return f"at pose {visit.id} on ball {visit.ball}"
