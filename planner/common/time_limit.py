"""A limit of time that a person sets for a plan: searches stop early and say what they left; proofs are never cut.

Each stage may begin nothing new once its share of the limit is over. What is then not as good or not as sure as without
a limit is noted, in words. Without a limit nothing looks at the clock, and the same seed gives the same bytes.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

import numpy as np

from planner.common.errors import NoSolutionError

CANDIDATES, ROADMAP, BOUND, CHOICE, REFINEMENT, TOUR = 0.2, 0.35, 0.55, 0.6, 0.7, 0.75
"""Shares of the limit after which a stage begins nothing new; what is left is for the path and its proofs."""


@dataclass
class TimeLimit:
    """``seconds`` from ``start`` [s of the clock]; ``left``: what was left undone, in words, in that order."""

    seconds: float
    start: float = field(default_factory=time.time)
    left: dict[str, None] = field(default_factory=dict)

    def is_over(self, share: float) -> bool:
        """Tell whether a share of the limit is over."""
        return time.time() - self.start > share * self.seconds

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person must know of a plan that was cut short."""
        return tuple(f"time limit of {self.seconds:g} s: {what}" for what in self.left)


_current: ContextVar[TimeLimit | None] = ContextVar("time limit", default=None)


def current_limit() -> TimeLimit | None:
    """Return the limit that holds, if any."""
    return _current.get()


@contextmanager
def limit_time(limit: TimeLimit | None) -> Iterator[None]:
    """Let a limit hold for what is done inside."""
    token = _current.set(limit)
    try:
        yield
    finally:
        _current.reset(token)


def must_stop(share: float, left: str) -> bool:
    """Tell whether a search is to stop, since a share of the limit is over; what it leaves undone is noted."""
    limit = _current.get()
    if limit is None or not limit.is_over(share):
        return False
    limit.left.setdefault(left)
    return True


def seconds_left(share: float) -> float:
    """Return the seconds until a share of the limit is over, at least one; infinite without a limit."""
    limit = _current.get()
    return np.inf if limit is None else max(1.0, limit.start + share * limit.seconds - time.time())


class TimeIsOverError(NoSolutionError):
    """The whole limit is over, and something that a plan cannot be without is not done."""


def check_time(doing: str) -> None:
    """Give up where the whole limit is over.

    Raises:
        TimeIsOverError: naming what was being done.
    """
    limit = _current.get()
    if limit is not None and limit.is_over(1.0):
        raise TimeIsOverError(
            f"the time limit of {limit.seconds:g} s is over while {doing}: no path is proven, so no program is "
            "written; raise --time-limit, ask for fewer --poses, or lower plan.candidates and motion.clearance_mm"
        )
