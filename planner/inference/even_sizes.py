"""Sizes drawn from a posterior, spread as evenly as it says.

A few dozen draws of a size that hardly any reading tells of miss its large values, or have too many of them: what 95 %
of robots stay below would hang on chance. What each draw says of all values of a size, averaged over the draws, is
known far better than which of them were drawn (Rao and Blackwell; Gelfand and Smith 1990, J. Am. Stat. Assoc. 85(410)).
"""

import numpy as np

from planner.common.units import Array


def spread_evenly(drawn: Array, values: Array, chance: Array, rng: np.random.Generator) -> Array:
    """Return the draws (d,) of a size, as many of each value as is likely, in the order of size that they had.

    Args:
        drawn: of the size, (d,).
        values: that it may have, rising, (k,).
        chance: of each, up to a factor, (k,).
        rng: says which of draws that are alike comes first.
    """
    count = len(drawn)
    order = np.lexsort([rng.random(count), drawn])
    places = np.searchsorted(np.cumsum(chance), (np.arange(count) + 0.5) / count * chance.sum())
    out = np.empty(count)
    out[order] = values[np.minimum(places, len(values) - 1)]
    return out
