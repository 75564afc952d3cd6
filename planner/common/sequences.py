"""Low-discrepancy points: successive draws fill the gaps of those before."""

from collections.abc import Callable, Sequence

import numpy as np

from planner.common.units import Array


def sobol_points(dimensions: int, seed: int | Sequence[int]) -> Callable[[int], Array]:
    """Return what draws so many scrambled Sobol points in the unit cube, (count, dimensions)."""
    from scipy.stats import qmc  # costs most of a second, and few commands need it

    sequence = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed))
    first = sequence.random(1)

    def draw(count: int) -> Array:
        nonlocal first
        points = np.vstack([first[:count], sequence.random(max(0, count - len(first)))])
        first = first[count:]
        return points

    return draw
