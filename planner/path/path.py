"""What joining the poses of a tour gives: the path, or what keeps it from being one."""

from dataclasses import dataclass

import numpy as np

from planner.units import Array


@dataclass(frozen=True)
class Leg:
    """The way from one pose of the tour to the next.

    Attributes:
        start, end: rows of the joined poses.
        supports: support poses between the two, (k, N) [rad].
    """

    start: int
    end: int
    supports: Array

    @property
    def direct(self) -> bool:
        """Whether one straight joint motion does."""
        return len(self.supports) == 0


@dataclass(frozen=True)
class Path:
    """A path that keeps every constraint throughout, proven continuously with both collision engines.

    Attributes:
        q: way points, supports included, (m, N) [rad].
        node: row of the pose at each way point, −1 at a support, (m,).
        legs: one from each pose to the next.
        clearance: smallest distance of two bodies seen on the path [m].
        length_min, length_max: of the bar, as seen on the path [m].
        checked: how the path was checked.
        verdicts: what each collision engine found.
    """

    q: Array
    node: np.ndarray
    legs: tuple[Leg, ...]
    clearance: float
    length_min: float
    length_max: float
    checked: str
    verdicts: tuple["Verdict", ...]

    @property
    def direct_legs(self) -> int:
        """Number of legs that are one straight joint motion."""
        return sum(leg.direct for leg in self.legs)

    @property
    def planned_legs(self) -> int:
        """Number of legs with support poses."""
        return len(self.legs) - self.direct_legs


@dataclass(frozen=True)
class Gaps:
    """Legs that could not be joined.

    Attributes:
        failed: pairs of poses (rows) without a proven way between them, smaller row first.
        unreachable: poses that no way reaches from any of their neighbours either; to be replaced.
        reasons: a sentence for each failed pair.
    """

    failed: tuple[tuple[int, int], ...]
    unreachable: tuple[int, ...]
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class Verdict:
    """What one collision engine says of a whole path.

    Attributes:
        engine: its name.
        clear: whether every motion is proven.
        clearance: smallest distance that it found [m].
        evaluations: states that it looked at.
        failures: a sentence for each motion that is not proven.
    """

    engine: str
    clear: bool
    clearance: float
    evaluations: int
    failures: tuple[str, ...]
