"""Annealing by heat bath: swaps are scored exactly, one is drawn by its Boltzmann weight, none is ever rejected.

Few poses for many parameters make a rugged landscape (each pose is a thirtieth of the information), where descent alone
sticks. Scores are changes of the :mod:`.potential`, whose barriers tighten while the temperature falls. Each draw looks at
a random handful of the pool, since many candidates are near copies of each other. One reading a pose and an index made
of determinants (O2, O3, O4) are assumed: then the scores are exact.
"""

import numpy as np

from planner.observability import rule
from planner.units import Array

from .potential import Potential
from .swaps import Table

_LOOK = 80  # candidates looked at in a draw
_HOT, _COLD = 0.010, 0.00125  # times (parameters / poses)^2: relative change of the squared index
_WIDE, _TIGHT = 0.75, 0.25  # likewise, the strength of the barriers: the fewer the poses, the coarser each swap


def anneal(rows: Array, chosen: Array, pool: Array, index: str, steps: int, seed: int) -> Array:
    """Return the best set met in ``steps`` swaps between ``chosen`` (n,) and ``pool`` (K,), candidates of ``rows``."""
    rng, better = np.random.default_rng(seed), rule(index)
    pool = np.union1d(pool, chosen)
    members, outer = np.searchsorted(pool, chosen), rows[pool]
    within = np.zeros(len(pool), dtype=bool)
    within[members] = True
    coarse = (rows.shape[2] / len(chosen)) ** 2
    best, best_value = members.copy(), np.nan
    for step in range(steps):
        share = step / steps
        strength = min(0.9, coarse * _WIDE * (_TIGHT / _WIDE) ** share)
        table = Table(outer[members], Potential(index, strength))
        value = float(better.of(np.sqrt(table.mu[::-1]), len(members)))
        if np.isnan(best_value) or better.better(value, best_value):
            best, best_value = members.copy(), value
        looked = rng.integers(0, len(pool), _LOOK)
        looked = looked[~within[looked]]
        if len(looked) == 0:
            continue
        out, into = _drawn(table.of(outer[looked]), coarse * _HOT * (_COLD / _HOT) ** share, rng)
        within[members[out]], within[looked[into]] = False, True
        members[out] = looked[into]
    return pool[best]


def _drawn(scores: Array, temperature: float, rng: np.random.Generator) -> tuple[int, int]:
    """Draw a pair with probability proportional to exp(score / temperature)."""
    scores -= np.max(scores)
    scores /= temperature
    total = np.cumsum(np.exp(scores, out=scores))
    place = min(int(np.searchsorted(total, rng.random() * total[-1])), len(total) - 1)
    out, into = divmod(place, scores.shape[1])
    return out, into
