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
class Verdict:
    """What one collision engine says of a whole path.

    Attributes:
        engine: its name.
        clear: whether every motion is proven.
        clearance: smallest distance of two bodies on the path, to half a millimetre [m].
        length_min, length_max: shortest and longest bar on the path, to half a millimetre [m].
        evaluations: states that it looked at.
        failures: a sentence for each motion that is not proven.
        unproven: which these are, counted from 0; blends count on after the motions.
    """

    engine: str
    clear: bool
    clearance: float
    length_min: float
    length_max: float
    evaluations: int
    failures: tuple[str, ...]
    unproven: tuple[int, ...] = ()


@dataclass(frozen=True)
class Path:
    """The whole way of a tour and both engines' verdict on it; released only if :attr:`clear`.

    Attributes:
        q: way points, supports included, (m, N) [rad].
        node: row of the pose at each way point, −1 at a support, (m,).
        legs: one from each pose to the next.
        verdict: what coal says.
        second: what python-fcl says.
        checked: how the path was checked.
    """

    q: Array
    node: np.ndarray
    legs: tuple[Leg, ...]
    verdict: Verdict
    second: Verdict
    checked: str = "continuous"

    @property
    def clear(self) -> bool:
        """Whether both engines prove every motion."""
        return self.verdict.clear and self.second.clear

    @property
    def clearance(self) -> float:
        """Smallest distance of two bodies that either engine found [m]."""
        return min(self.verdict.clearance, self.second.clearance)

    @property
    def length_min(self) -> float:
        """Shortest bar on the path [m]."""
        return self.verdict.length_min

    @property
    def length_max(self) -> float:
        """Longest bar on the path [m]."""
        return self.verdict.length_max

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
        unreachable: poses in parts of the roadmap that no way leads to from the first pose's; to be replaced.
        reasons: a sentence for each failed pair.
    """

    failed: tuple[tuple[int, int], ...]
    unreachable: tuple[int, ...]
    reasons: tuple[str, ...]
