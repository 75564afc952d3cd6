"""What a person at the cell does with a gauge, in words."""

from dataclasses import dataclass

from planner.kinematics.bodies import Vector


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
