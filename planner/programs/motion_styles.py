"""How a dialect says the motion itself: corners, speeds, circles of the tool, and whose the override is."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from planner.common.schema import StrictModel, check_pattern

BlendKind = Literal["none", "mm", "percent", "path_degrees", "dense"]
SpeedKind = Literal["axis_percent", "tool_speed", "inverse_time", "leading_axis", "duration"]

Pattern = Annotated[str, AfterValidator(check_pattern)]


class BlendStyle(StrictModel):
    """How a corner is cut; ``percent`` is of half the leg, ``path_degrees`` of joint path."""

    kind: BlendKind
    word: str = ""
    exact: str = ""
    decimals: int = Field(default=0, ge=0, le=4)
    dense_deg: float = Field(default=1.0, gt=0)
    tolerance: str = ""


class SpeedStyle(StrictModel):
    """How the speed of a segment is stated. ``reductions``: coarse percentages of the program's own, that scale
    ``axis_percent`` and change at stops only; the operator's override is never one of them.

    A ``duration`` is longer than the planned one of the segment, so that the peak speed stays within the plan: times
    ``ease``, the ratio of peak to mean speed in the controller's profile between two stops, plus ``ramp_s``. With
    ``stream``, the receiver of the program limits no acceleration, so the program holds the ramps itself: goals with
    velocities that are joined by cubics, or ``frames``, ``word`` of them a second.

    ``approach`` is the word of the first move, which begins wherever the arm stands. ``approach_first``: axes that go
    there alone before the others, where F is the speed of the others alone while one of those moves; ``least``: the
    slowest that the controller then drives the others in inverse time [deg/min].
    """

    kind: SpeedKind
    word: str = ""
    unit: Literal["%", "mm/s", "mm/min", "1/min", "deg/s", "s"]
    decimals: int = Field(ge=0, le=6)
    reductions: tuple[int, ...] = (100,)
    ease: float = Field(default=1.0, ge=1.0)
    ramp_s: float = Field(default=0.0, ge=0.0)
    stream: Literal["", "cubic", "frames"] = ""
    approach: str = ""
    approach_first: tuple[str, ...] = ()
    least: float = Field(default=0.0, ge=0.0)
    note: str = ""


class OverrideStyle(StrictModel):
    """What the operator slows the robot with, which no program sets or switches off.

    ``knob`` names it, empty where the controller has none; ``note`` says what else the operator must know of it, such
    as that it goes beyond 100 %.
    """

    knob: str
    note: str = ""

    @property
    def sentence(self) -> str:
        """Return the sentence in the head of a program about the motion style."""
        said = (
            f"{self.knob} is the operator's: this program neither sets it nor switches it off, turned down at any "
            "moment it slows the robot, and stays; the speeds are those at 100 %"
        )
        return "; ".join(filter(None, (said if self.knob else "", self.note)))


class CircleStyle(StrictModel):
    """How a circle of the tool is said: its speed, and how a corner between two pieces of it is cut [mm].

    ``passive``: what a program with circles may hold beside them, as in ``[reading]``.
    """

    unit: Literal["mm/s", "m/s"]
    decimals: int = Field(ge=0, le=6)
    blend_decimals: int = Field(default=1, ge=0, le=4)
    n_joints: int = 6
    passive: tuple[Pattern, ...] = ()

    @property
    def mm_s(self) -> float:
        """Return the size of the unit [mm/s]."""
        return 1000.0 if self.unit == "m/s" else 1.0
