"""What stops a centring: errors at the cell, and a request by a person, a signal or a file."""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from planner.common.errors import NoSolutionError


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


class StopRequest:
    """What everything that waits looks at; ``file`` asks for a stop by being there."""

    def __init__(self, file: Path | None = None) -> None:
        self.file = file
        self.asked = ""

    def ask(self, who: str) -> None:
        """Ask for a stop at the next look."""
        self.asked = who

    def check(self) -> None:
        """Stop here if a stop was asked for.

        Raises:
            StoppedError: a stop was asked for.
        """
        if not self.asked and self.file is not None and self.file.exists():
            self.asked = f"the file {self.file}"
        if self.asked:
            raise StoppedError(f"stopped by {self.asked}")

    def wait(self, seconds: float) -> None:
        """Wait, looking all the while."""
        until = time.monotonic() + seconds
        while True:
            self.check()
            left = until - time.monotonic()
            if left <= 0.0:
                return
            time.sleep(min(left, 0.02))  # [s] between two looks while waiting


@contextmanager
def stop_on_signals(stop: StopRequest) -> Iterator[StopRequest]:
    """Turn Ctrl-C and a termination signal into a stop while the block runs; a second one ends the program at once."""

    def on_signal(number: int, _frame: FrameType | None) -> None:
        """Ask for a stop."""
        stop.ask("Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name)
        signal.signal(number, before[number])

    before = {int(number): signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        signal.signal(number, on_signal)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
