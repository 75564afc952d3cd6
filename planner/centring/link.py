"""What a centring needs of a robot; a controller is one class behind this."""

from typing import Protocol

from planner.units import Array


class RobotLink(Protocol):
    """A robot that is told where to go, and waits there. Every call returns when the arm stands still.

    All raise LinkError where the robot does not answer or does not do it, StoppedError where a stop was asked for.
    """

    def move(self, q: Array, slow: bool = False) -> None:
        """Go to the controller angles q (N,) [rad], joint by joint; ``slow`` where tips and ball touch."""

    def shift(self, step: Array) -> None:
        """Move the tool by ``step`` (3,) [m] in its own frame, on a line."""

    def joints(self) -> tuple[Array, Array]:
        """Return the controller angles as read and as commanded, both (N,) [rad]."""

    def orientation(self) -> Array:
        """Return R_BT (3, 3), the tool's axes in the controller's base."""

    def arrive(self) -> int:
        """Wait until the plan's own program stands at a ball, and return the pose's id."""

    def release(self) -> None:
        """Let that program go on."""

    def stop(self) -> None:
        """Stop the arm now; never raises."""

    def close(self) -> None:
        """Let the robot go."""
