"""How much of a command is done, by the share of its time at which each of its stages usually begins."""

import time
from collections.abc import Mapping

PLAN = {
    "fixtures": 0.0, "candidates": 0.02, "roadmap": 0.14, "foresight": 0.28, "selection": 0.38, "separation": 0.56,
    "refinement": 0.58, "path": 0.66, "index curve": 0.83, "programs": 0.84, "report": 0.88,
}  # fmt: skip
STUDY = {
    "candidates": 0.0,
    "what is seen": 0.1,
    "index curves": 0.12,
    "fixture places": 0.3,
    "fixtures": 0.8,
    "pictures": 0.9,
}
IDENTIFY = {
    "reading": 0.0, "placing the gauge": 0.02, "nominal robot": 0.03, "frames": 0.04, "geometry": 0.06, "rivals": 0.42,
    "detection limits": 0.46, "calibrated robot": 0.5, "report": 0.85,
}  # fmt: skip
UNKNOWN = 0.15  # of the way to the next stage, for a step that nobody foresaw: how many come is not known
EARLY = 0.04  # below this share a guess of the time left is worth nothing


class TimeLeft:
    """Estimates the time left of a command: what has gone, times what is left over what is done.

    Args:
        starts: share of the command's time at which each stage usually begins.
    """

    def __init__(self, starts: Mapping[str, float]) -> None:
        self._starts, self._begun = starts, time.monotonic()
        self._stage, self._at, self._next = "", 0.0, 0.0
        self.share = 0.0

    def update(self, stage: str, done: int, of: int) -> None:
        """Take note of a stage, how much of it is done, and of how much (0 where that is not known)."""
        if stage != self._stage:
            self._stage = stage
            self._at = self._starts.get(stage, self._at + UNKNOWN * (self._next - self._at))
            self._next = min((s for s in self._starts.values() if s > self._at), default=1.0)
        now = self._at + (self._next - self._at) * (done / of if of else 0.0)
        self.share = max(self.share, now)

    @property
    def text(self) -> str:
        """What is left, in words; empty as long as nobody can know."""
        if self.share < EARLY:
            return ""
        left = (time.monotonic() - self._begun) * (1 - self.share) / self.share
        return f"about {left / 60:.0f} min left" if left > 90 else f"about {max(5 * round(left / 5), 5)} s left"
