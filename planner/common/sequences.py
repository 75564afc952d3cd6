"""Low-discrepancy points: successive draws fill the gaps of those before."""

from collections.abc import Callable, Sequence
from warnings import catch_warnings, simplefilter

import numpy as np

from planner.common.units import Array


def sobol_points(dimensions: int, seed: int | Sequence[int] | None) -> Callable[[int], Array]:
    """Return a function that draws Sobol points in the unit cube, (count, dimensions), scrambled with a ``seed``."""
    from scipy.stats import qmc  # costs half a second

    sequence = qmc.Sobol(dimensions, scramble=seed is not None, rng=np.random.default_rng(seed))

    def draw(count: int) -> Array:
        """Return the next ``count`` points, (count, dimensions)."""
        with catch_warnings():
            simplefilter("ignore", UserWarning)  # their number need be no power of two
            return np.asarray(sequence.random(count))

    return draw
