"""Annealing by heat bath: every swap is scored exactly, one is drawn by its Boltzmann weight, none is ever rejected.

Few poses for many parameters make a rugged landscape (each pose is a thirtieth of the information), where descent alone
sticks. Scores are changes of the :mod:`.potential`, whose barriers tighten while the temperature falls. One reading a
pose and an index made of determinants (O2, O3, O4) are assumed: then the scores are exact.
"""

import numpy as np

from planner.observability import rule
from planner.units import Array

from .potential import Potential
from .swaps import Table

_HOT, _COLD = 0.01, 0.001  # relative changes of the squared index
_WIDE, _TIGHT = 0.3, 0.1  # strength of the barriers


def anneal(rows: Array, chosen: Array, pool: Array, index: str, steps: int, seed: int) -> Array:
    """Return the best set met in ``steps`` swaps between ``chosen`` (n,) and ``pool`` (K,), candidates of ``rows``."""
    rng, better = np.random.default_rng(seed), rule(index)
    pool = np.union1d(pool, chosen)
    members, outer = np.searchsorted(pool, chosen), rows[pool]
    best, best_value = members, np.nan
    for step in range(steps):
        share = step / steps
        table = Table(outer[members], Potential(index, _WIDE * (_TIGHT / _WIDE) ** share))
        value = float(better.of(np.sqrt(table.mu[::-1]), len(members)))
        if not better.better(best_value, value) and value != best_value:
            best, best_value = members, value
        scores = table.of(outer)
        scores[:, members] = -np.inf
        out, into = _drawn(scores, _HOT * (_COLD / _HOT) ** share, rng)
        members = members.copy()
        members[out] = into
    return pool[best]


def _drawn(scores: Array, temperature: float, rng: np.random.Generator) -> tuple[int, int]:
    """Draw a pair with probability proportional to exp(score / temperature)."""
    scores -= np.max(scores)
    scores /= temperature
    total = np.cumsum(np.exp(scores, out=scores))
    place = min(int(np.searchsorted(total, rng.random() * total[-1])), len(total) - 1)
    out, into = divmod(place, scores.shape[1])
    return out, into
