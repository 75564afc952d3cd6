"""Low-discrepancy points: successive draws fill the gaps of those before.

The points of ``scipy.stats.qmc.Sobol``, to the bit: that package takes most of a second to load.
"""

from collections.abc import Callable, Sequence

import numpy as np

from planner.common.errors import InputError
from planner.common.units import Array

BITS = 30  # of a coordinate
# Of each dimension but the first: primitive polynomial and initial direction numbers (Joe and Kuo 2008, new-joe-kuo-6)
DIRECTIONS = (
    (3, 1),
    (7, 1, 3),
    (11, 1, 3, 1),
    (13, 1, 1, 1),
    (19, 1, 1, 3, 3),
    (25, 1, 3, 5, 13),
    (37, 1, 1, 5, 5, 17),
    (41, 1, 1, 5, 5, 5),
    (47, 1, 1, 7, 11, 19),
    (55, 1, 1, 5, 1, 1),
    (59, 1, 1, 1, 3, 11),
    (61, 1, 3, 5, 5, 31),
    (67, 1, 3, 3, 9, 7, 49),
    (91, 1, 1, 1, 15, 21, 21),
    (97, 1, 3, 1, 13, 27, 49),
)


def sobol_points(dimensions: int, seed: int | Sequence[int] | None) -> Callable[[int], Array]:
    """Return a function that draws Sobol points in the unit cube, (count, dimensions), scrambled with a ``seed``.

    Scrambled by a random triangular matrix and a shift (Matousek 1998, J. Complexity 14).

    Raises:
        InputError: there are no directions for so many dimensions.
    """
    if dimensions > len(DIRECTIONS) + 1:
        raise InputError(f"a robot of {dimensions} or more joints cannot be planned; at most {len(DIRECTIONS) + 1} can")
    v = np.array([_directions(d) for d in range(dimensions)])
    last = np.zeros(dimensions, dtype=np.int64)
    if seed is not None:
        rng, powers = np.random.default_rng(seed).spawn(1)[0], 1 << np.arange(BITS)
        last = rng.integers(2, size=(dimensions, BITS), dtype=np.uint32) @ powers
        matrix = np.tril(rng.integers(2, size=(dimensions, BITS, BITS), dtype=np.uint32))
        matrix[:, np.arange(BITS), np.arange(BITS)] = 1
        bits = v[:, None, :] >> np.arange(BITS)[::-1, None] & 1  # (dimensions, bit, direction), the highest bit first
        v = powers[::-1] @ (matrix.astype(float) @ bits % 2).astype(int)
    done = 0

    def draw(count: int) -> Array:
        """Return the next ``count`` points, (count, dimensions)."""
        nonlocal done, last
        index = np.arange(max(done, 1), done + count)
        steps = v.T[np.bitwise_count((index & -index) - 1)]
        points = np.bitwise_xor.accumulate(np.vstack([last, steps]), axis=0)
        out, last = points[-count:] if count else points[:0], points[-1]
        done += count
        return np.asarray(out * 2.0**-BITS)

    return draw


def _directions(dimension: int) -> list[int]:
    """Direction numbers of one dimension (Bratley and Fox 1988, algorithm 659)."""
    if dimension == 0:
        return [1 << BITS - 1 - k for k in range(BITS)]
    polynomial, *v = DIRECTIONS[dimension - 1]
    degree = len(v)
    for k in range(degree, BITS):
        new = v[k - degree]
        for j in range(degree):
            new ^= (polynomial >> degree - 1 - j & 1) * v[k - j - 1] << j + 1
        v.append(new)
    return [m << BITS - 1 - k for k, m in enumerate(v)]
