"""What is passed between a gauge and those who plan with it: bodies, samples, travel, poses, steps of a person."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, Protocol

from planner.common.units import Array, Rows
from planner.kinematics.bodies import Body, Vector
from planner.runs.run import Mounting


@dataclass(frozen=True)
class CellStep:
    """One step of a person at the cell."""

    title: str
    text: str


READY = CellStep("Make the gauge ready", "Where the program pauses: make the gauge ready to read.")


@dataclass(frozen=True)
class SessionGuide:
    """What a person at the cell does with a gauge.

    Attributes:
        logged: what a row of the log holds beside time and joint angles.
        before: steps before the robot drives.
        at_start: steps where the program pauses, before the first reading.
        at_poses: what is done while the program runs.
        after: steps after the last pose.
    """

    logged: str
    before: tuple[CellStep, ...] = ()
    at_start: tuple[CellStep, ...] = (READY,)
    at_poses: str = "Stay beside it."
    after: tuple[CellStep, ...] = ()


def place_text(position_mm: Vector) -> str:
    """Say a place as a cell file does."""
    return f"[{', '.join(f'{v:g}' for v in position_mm)}] mm"


FilterStage = str
BodyCarrier = Literal["world", "flange", "housing", "rod"]


@dataclass(frozen=True)
class GaugeBody:
    """One body that a gauge brings into the cell.

    Attributes:
        body: the shape, in the frame of its carrier.
        carrier: the base frame, the flange, or a line between place and tool point: ``housing`` begins at the place,
            ``rod`` at the tool point, both with z from the place to the tool point; they are there only while it reads.
        ball: which ball of an artifact it is, or −1.
        tip: whether it may touch the ball that is measured.
    """

    body: Body
    carrier: BodyCarrier
    ball: int = -1
    tip: bool = False


class RecordedPose(Protocol):
    """What a plan's file says of a pose."""

    q_deg: tuple[float, ...]
    length_mm: float | None
    fixture: str
    point: str
    ball: str | None


class PlannedVisit(Protocol):
    """What a gauge needs to know of a planned pose to describe it."""

    @property
    def length(self) -> float:
        """Nominal distance from the place to the tool point [m]."""

    @property
    def mounting(self) -> Mounting:
        """At which of the cell's fixtures, and which of the tool's points."""

    @property
    def q(self) -> Array:
        """Controller angles, (N,) [rad]."""

    @property
    def ball(self) -> int:
        """Which ball is centred there, or −1."""

    @property
    def contact(self) -> float | None:
        """Distance from a ball's centre at which the uncalibrated robot meets it [m]."""


@dataclass(frozen=True)
class JointSamples:
    """States at which a gauge may be able to read.

    Attributes:
        q: controller angles, (n, N) [rad].
        stands_for: how many uniform joint samples, tested one by one, would have given as many.
    """

    q: Array
    stands_for: int


@dataclass(frozen=True)
class PointTravel(Rows):
    """Bounds on how far a neighbourhood of joint states moves the measured point, one entry a neighbourhood.

    Attributes:
        move: path length of the point [m].
        stretch: change of its distance from the place [m].
        swing: path length of the direction from the place to it [rad].
        turn: of the tool [rad].
    """

    move: Array
    stretch: Array
    swing: Array
    turn: Array


@dataclass(frozen=True)
class LeftStanding:
    """What of a gauge stays as it is where nobody moves it after a run.

    Attributes:
        names: of its parameters in the model of the run, and as the cell of the last session alone has them.
        places: (3,) [m] that the parameters count from, by the names that this cell has for them.
    """

    names: Mapping[str, str] = field(default_factory=dict)
    places: Mapping[str, Array] = field(default_factory=dict)
