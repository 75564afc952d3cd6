"""What stops a centring; the robot is stopped first, what was measured is kept."""

from planner.errors import NoSolutionError


class CentringError(NoSolutionError):
    """Root of everything that stops a session at the cell."""


class StoppedError(CentringError):
    """A person asked for it."""


class SilentError(CentringError):
    """An indicator does not answer, or not in its own language."""


class UnsettledError(CentringError):
    """The readings do not come to rest."""


class ContactError(CentringError):
    """An indicator stands at its free end, or touches where it must not."""


class RangeError(CentringError):
    """An indicator is pushed in further than it may be used, or a move would leave its limits."""


class StuckError(CentringError):
    """The robot moved and an indicator did not."""


class DivergingError(CentringError):
    """The ball goes away instead of coming nearer, or does not come near enough."""


class LinkError(CentringError):
    """The robot does not answer, refuses, or does not do what it was told."""
