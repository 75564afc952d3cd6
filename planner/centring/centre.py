"""The auto-centring of the TriCal paper (Figure 6) with a cell's safeguards: read, move by what was read, again."""

from dataclasses import dataclass

import numpy as np

from planner.centring.errors import DivergingError, RangeError
from planner.centring.indicators import Indicators
from planner.centring.link import RobotLink
from planner.centring.resting import at_rest
from planner.centring.safeguards import Watch, check_contact
from planner.centring.settings import MovesFile, Settings
from planner.centring.stopping import Stop
from planner.units import MM, UM, Array, frozen, to_mm

NEAR = (
    10.0  # times the tolerance: from here on it is the scatter with which the arm lands that keeps it from the centre
)
AVERAGED = 4  # then smaller and smaller parts of what is read are moved, so that the target goes to the middle of that


@dataclass(frozen=True)
class Centred:
    """A ball in the middle of the head.

    Attributes:
        reading: of the three indicators at the end, (3,) [m].
        p_TB: the ball's centre in the tool frame at the end, (3,) [m].
        found: the same at first contact, (3,) [m].
        moved: the way of the tool from the planned pose, in its own frame, (3,) [m].
        moves: how many it took.
    """

    reading: Array
    p_TB: Array
    found: Array
    moved: Array
    moves: int


def centre(indicators: Indicators, link: RobotLink, settings: Settings, stop: Stop) -> Centred:
    """Bring the tool's point to the ball that the three indicators touch.

    Raises:
        ContactError, RangeError: an indicator is at its free end or out of range, or a move would go too far.
        StuckError, DivergingError: an indicator does not follow, or the ball does not come nearer.
        SilentError, UnsettledError, LinkError, StoppedError: see there.
    """
    limits, to_tool = settings.moves, settings.to_tool
    watch, moved, near = Watch(to_tool, limits), np.zeros(3), 0
    found: Array | None = None
    for moves in range(limits.most_moves + 1):
        reading = at_rest(indicators, settings.rest, stop)
        check_contact(reading, settings.head)
        watch.check(reading)
        p_TB = to_tool @ reading
        found = p_TB if found is None else found
        if np.all(np.abs(reading) < limits.tolerance_um * UM):
            return Centred(reading, frozen(p_TB), frozen(found), frozen(moved), moves)
        near += bool(np.all(np.abs(reading) < NEAR * limits.tolerance_um * UM))
        step = _limited(p_TB / min(max(near - 1, 1), AVERAGED), limits, first=moves == 0)
        if np.linalg.norm(moved + step) > limits.travel_mm * MM:
            raise RangeError(
                f"the next move would take the tool {np.linalg.norm(moved + step) / MM:.2f} mm away from the planned "
                f"pose; {limits.travel_mm:g} mm are allowed"
            )
        if moves < limits.most_moves:
            link.shift(step)
            moved = moved + step
            watch.moved(step)
    shown = ", ".join(f"{1e3 * v:+.1f}" for v in to_mm(reading))
    raise DivergingError(
        f"after {limits.most_moves} moves the indicators still show {shown} µm (x, y, z); "
        f"{limits.tolerance_um:g} µm are wanted: the robot does not repeat well enough, or the head is loose"
    )


def _limited(step: Array, limits: MovesFile, first: bool) -> Array:
    """Shorten a step [m] to what may be moved at once; the first one is a careful one."""
    most = (limits.first_step_mm if first else limits.step_mm) * MM
    size = float(np.linalg.norm(step))
    return step if size <= most else step * (most / size)
