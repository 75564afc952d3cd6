"""What a long task is doing: its stages, their progress, and the seconds that each took."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

Progress = Callable[[str, int, int], None]
"""Called with the stage, how much of it is done, and of how much (0 where that is not known)."""


def no_progress(stage: str, done: int, of: int) -> None:
    """Pass over what is going on."""


@dataclass
class Stages:
    """Says what is going on and keeps the seconds of each stage."""

    say: Progress = no_progress
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[Callable[[int, int], None]]:
        """Time one stage; yields a callback for its progress (done, of)."""
        start = time.perf_counter()
        self.say(name, 0, 0)
        yield lambda done, of: self.say(name, done, of)
        self.seconds[name] = round(self.seconds.get(name, 0.0) + time.perf_counter() - start, 3)
