"""The figures that a validation is told by, in the manner of ISO 9283: of how far the tool is from where it should."""

from dataclasses import dataclass

import numpy as np

from planner.errors import InputError
from planner.units import Array, to_mm

PERCENTS = (50, 90, 95, 99)


@dataclass(frozen=True)
class Figures:
    """Figures of n position errors.

    Attributes:
        count: n.
        mean, largest, std: of the errors [m]; ``std`` with n − 1, as in ISO 9283.
        percentiles: (per cent, error) pairs [m].
    """

    count: int
    mean: float
    largest: float
    std: float
    percentiles: tuple[tuple[int, float], ...]

    def text(self) -> str:
        """Return them as a person reads them, in mm."""
        parts = ", ".join(f"{share} % within {float(to_mm(v)):.3f}" for share, v in self.percentiles)
        mean, largest, std = (float(to_mm(v)) for v in (self.mean, self.largest, self.std))
        return f"{self.count} poses: mean {mean:.3f}, max {largest:.3f}, std {std:.3f} mm; {parts}"


def figures(error: Array) -> Figures:
    """Return the figures of position errors (n, 3), or of their lengths (n,), [m].

    Raises:
        InputError: fewer than two errors.
    """
    size = np.linalg.norm(error, axis=1) if np.ndim(error) == 2 else np.asarray(error, dtype=float)
    if len(size) < 2:
        raise InputError(f"figures of accuracy need two poses at least, found {len(size)}")
    percentiles = tuple((p, float(np.percentile(size, p))) for p in PERCENTS)
    return Figures(len(size), float(size.mean()), float(size.max()), float(size.std(ddof=1)), percentiles)
