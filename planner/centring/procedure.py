"""Auto-centring of the TriCal paper (Figure 6), with the checks of contact, range and following before each move."""

from dataclasses import dataclass

import numpy as np

from planner.centring.indicators import Indicators, read_settled_indicators
from planner.centring.robot_link import RobotLink
from planner.centring.settings import CentringSettings, HeadSettings, MoveSettings
from planner.centring.stop import ContactError, DivergingError, RangeError, StopRequest, StuckError
from planner.common.units import MM, UM, Array, read_only, to_mm

NAMES = ("x", "y", "z")
STUCK_SHARE = 0.2  # of the movement that was to be seen: less, and an indicator is stuck


def check_contact(reading: Array, head: HeadSettings) -> None:
    """Every indicator must touch the ball, and be used no further than it may.

    Raises:
        ContactError: a plunger stands at its free end.
        RangeError: a plunger is pushed in too far.
    """
    shown = to_mm(reading)
    for name, value in zip(NAMES, shown, strict=True):
        if value <= -head.usable_mm:
            raise ContactError(
                f"indicator {name} shows {value:+.3f} mm (usable are ±{head.usable_mm:g} mm), so it does not touch the "
                "ball: that is further away than the head can reach, or the contact was lost"
            )
        if value >= head.usable_mm:
            raise RangeError(
                f"indicator {name} shows {value:+.3f} mm; usable are ±{head.usable_mm:g} mm: "
                "the ball stands too far in the head"
            )


def check_free(reading: Array, head: HeadSettings) -> None:
    """Off the ball every plunger must stand at its free end: one that does not is stuck, or touches something.

    Raises:
        ContactError: an indicator shows that it touches.
    """
    for name, value in zip(NAMES, to_mm(reading), strict=True):
        if value > -head.usable_mm:
            raise ContactError(
                f"indicator {name} shows {value:+.3f} mm off the ball, where it should stand at its free end (below "
                f"−{head.usable_mm:g} mm): its plunger is stuck, it was mastered wrongly, or it touches something"
            )


@dataclass
class FollowingCheck:
    """Follows one centring and compares what each indicator shows with what the moves should have done.

    Attributes:
        to_tool: matrix from readings to the ball in the tool frame, (3, 3).
    """

    to_tool: Array
    limits: MoveSettings

    def __post_init__(self) -> None:
        self._first: Array | None = None
        self._last: Array | None = None
        self._best = np.inf
        self._moved, self._step = np.zeros(3), np.zeros(3)

    def note_move(self, step: Array) -> None:
        """Note a move of the tool by ``step`` (3,) [m] in its own frame."""
        self._step, self._moved = step, self._moved + step

    def check(self, reading: Array) -> None:
        """Compare a new reading (3,) [m] with the moves so far.

        Raises:
            StuckError: an indicator does not follow.
            DivergingError: one goes the other way, by another measure, or the ball goes away.
        """
        if self._first is None or self._last is None:
            self._first = reading
        else:
            self._follows(reading - self._last, self._step)
            self._follows(reading - self._first, self._moved)
        distance = float(np.linalg.norm(self.to_tool @ reading))
        # 1.5: times the best so far is no centring
        if distance > max(1.5 * self._best, self._best + self.limits.judge_mm * MM):
            raise DivergingError(
                f"the ball was {self._best / MM:.3f} mm from the centre and is {distance / MM:.3f} mm from it now: "
                "check signs and order of the indicators and the tool frame of the controller"
            )
        self._best, self._last = min(self._best, distance), reading

    def _follows(self, seen: Array, step: Array) -> None:
        """A tool that moves by ``step`` takes the ball the other way in its own frame."""
        expected = np.linalg.solve(self.to_tool, -step)
        # 0.3: share of the largest expected movement: smaller ones are ruled by how the head is tilted
        judged = np.abs(expected) >= max(self.limits.judge_mm * MM, 0.3 * float(np.abs(expected).max()))
        share = np.divide(seen, expected, out=np.ones(3), where=judged)
        still = judged & (np.abs(share) < STUCK_SHARE)
        if judged.any() and np.array_equal(still, judged) and judged.sum() > 1:
            raise StuckError("the robot was moved and no indicator followed: the robot did not move, or no tip touches")
        slow = 0.5  # share of the expected movement below which an indicator does not show what it should
        fast = 1.5  # share above which it does not either
        for k in np.flatnonzero(judged & ((share < slow) | (share > fast))):
            raise _following_error(NAMES[k], float(seen[k]), float(expected[k]), float(share[k]))


def _following_error(name: str, seen: float, expected: float, share: float) -> StuckError | DivergingError:
    moved = f"indicator {name} changed by {seen / MM:+.3f} mm where {expected / MM:+.3f} mm were to be seen"
    if abs(share) < STUCK_SHARE and not 0.03 < share < 0.05:
        return StuckError(f"{moved}: it is stuck, frozen (HOLD), or along another axis")
    if 0.03 < share < 0.05:
        return StuckError(f"{moved}: does it show inches?")
    if share < 0.0:
        return DivergingError(f"{moved}: it reads the other way round; turn its sign in the matrix of the head")
    return DivergingError(f"{moved}: the tool frame of the controller does not lie along the indicators")


@dataclass(frozen=True)
class CentredBall:
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


def centre_ball(indicators: Indicators, link: RobotLink, settings: CentringSettings, stop: StopRequest) -> CentredBall:
    """Bring the tool's point to the ball that the three indicators touch.

    Raises:
        ContactError, RangeError: an indicator is at its free end or out of range, or a move would go too far.
        StuckError, DivergingError: an indicator does not follow, or the ball does not come nearer.
        SilentError, UnsettledError, LinkError, StoppedError: see there.
    """
    limits, to_tool = settings.moves, settings.to_tool
    watch, moved, near = FollowingCheck(to_tool, limits), np.zeros(3), 0
    found: Array | None = None
    for moves in range(limits.most_moves + 1):
        reading = read_settled_indicators(indicators, settings.rest, stop)
        check_contact(reading, settings.head)
        watch.check(reading)
        p_TB = to_tool @ reading
        found = p_TB if found is None else found
        if np.all(np.abs(reading) < limits.tolerance_um * UM):
            return CentredBall(reading, read_only(p_TB), read_only(found), read_only(moved), moves)
        # 10.0: times the tolerance: nearer, the scatter with which the arm lands keeps it from the centre
        near += bool(np.all(np.abs(reading) < 10.0 * limits.tolerance_um * UM))
        # 4: then smaller and smaller parts of what is read are moved, so that the target goes to the middle of the
        # scatter
        step = _limit_step(p_TB / min(max(near - 1, 1), 4), limits, first=moves == 0)
        if np.linalg.norm(moved + step) > limits.travel_mm * MM:
            raise RangeError(
                f"the next move would take the tool {np.linalg.norm(moved + step) / MM:.2f} mm away from the planned "
                f"pose; {limits.travel_mm:g} mm are allowed"
            )
        if moves < limits.most_moves:
            link.shift(step)
            moved = moved + step
            watch.note_move(step)
    shown = ", ".join(f"{1e3 * v:+.1f}" for v in to_mm(reading))
    raise DivergingError(
        f"after {limits.most_moves} moves the indicators still show {shown} µm (x, y, z); "
        f"{limits.tolerance_um:g} µm are wanted: the robot does not repeat well enough, or the head is loose"
    )


def _limit_step(step: Array, limits: MoveSettings, first: bool) -> Array:
    """Shorten a step [m] to what may be moved at once; the first one is a careful one."""
    most = (limits.first_step_mm if first else limits.step_mm) * MM
    size = float(np.linalg.norm(step))
    return step if size <= most else step * (most / size)
