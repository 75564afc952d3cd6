"""What a long task is doing: its stages, their progress and seconds; and how long it may take."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum

from planner.common.errors import NoSolutionError

Progress = Callable[[str, int, int], None]
"""Called with the stage, how much of it is done, and of how much (0 where that is not known)."""
StageProgress = Callable[[int, int], None]
"""Called within one stage with how much of it is done, and of how much."""
StageReport = Callable[[str], None]
"""Called with each stage as it begins."""


def no_progress(stage: str, done: int, of: int) -> None:
    """Pass over what is going on."""


class LastStart(float, Enum):
    """Share of a limit after which a stage begins nothing new; what is left is for the path and its proofs."""

    CANDIDATES = 0.2
    ROADMAP = 0.35
    BOUND = 0.55
    CHOICE = 0.6
    REFINEMENT = 0.7
    TOUR = 0.75


class TimeIsOverError(NoSolutionError):
    """The whole limit is over, and something that a plan cannot be without is not done."""


@dataclass(eq=False)  # one limit is shared by all that it cuts
class TimeLimit:
    """``seconds`` from ``start`` [s of the clock]; ``left``: what was left undone, in words, in that order."""

    seconds: float
    start: float = field(default_factory=time.time)
    left: dict[str, None] = field(default_factory=dict)

    def is_over(self, share: float) -> bool:
        """Tell whether a share of the limit is over."""
        return math.isfinite(self.seconds) and time.time() - self.start > share * self.seconds

    def must_stop(self, share: float, left: str) -> bool:
        """Tell whether a search is to stop, since a share of the limit is over; what it leaves undone is noted."""
        if not self.is_over(share):
            return False
        self.left.setdefault(left)
        return True

    def remaining_seconds(self, share: float) -> float:
        """Return the seconds until a share of the limit is over, at least one; infinite without a limit."""
        return max(1.0, self.start + share * self.seconds - time.time())

    def check(self, doing: str) -> None:
        """Give up where the whole limit is over.

        Raises:
            TimeIsOverError: naming what was being done.
        """
        if self.is_over(1.0):
            raise TimeIsOverError(
                f"the time limit of {self.seconds:g} s is over while {doing}: no path is proven, so no program is "
                "written; raise --time-limit-s, ask for fewer --poses, or lower plan.candidates and motion.clearance_mm"
            )

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person must know of a plan that was cut short."""
        return tuple(f"time limit of {self.seconds:g} s: {what}" for what in self.left)


UNLIMITED = TimeLimit(math.inf, 0.0)  # [s] it is never over, so that nothing is ever noted in it


@dataclass
class Stages:
    """Says what is going on and keeps the seconds of each stage; ``limit``: how long all of them may take."""

    say: Progress = no_progress
    limit: TimeLimit = UNLIMITED
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[StageProgress]:
        """Time one stage; yields a callback for its progress (done, of)."""
        start = time.perf_counter()
        self.say(name, 0, 0)
        yield lambda done, of: self.say(name, done, of)
        self.seconds[name] = round(self.seconds.get(name, 0.0) + time.perf_counter() - start, 3)
