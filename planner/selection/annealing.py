"""Annealing by heat bath: swaps are scored exactly, one is drawn by its Boltzmann weight, none is ever rejected.

Few poses for many parameters make a rugged landscape (each pose is a thirtieth of the information), where descent alone
sticks. Scores are changes of the :mod:`.potential`, whose barriers tighten while the temperature falls. Each draw looks
at a random handful of the pool, since many candidates are near copies of each other. One reading a pose and an index
made of determinants (O2, O3, O4) are assumed: then the scores are exact.
"""

import numpy as np

from planner.observability import rule
from planner.repeatable import Places
from planner.units import Array

from .potential import Potential
from .swaps import Table

_LOOK, _LOOK_EACH = 100, 2  # candidates looked at in a draw: at least, and for each pose
_HOT, _COLD = 0.015, 0.0008  # times (parameters / poses)^2: relative change of the squared index
_WIDE, _TIGHT = 0.5, 0.25  # barrier strength, times that ratio and times its square: few poses make coarse swaps


def anneal(rows: Array, chosen: Places, pool: Places, index: str, steps: int, seed: int) -> Places:
    """Return the best set met in ``steps`` swaps between ``chosen`` (n,) and ``pool`` (K,), candidates of ``rows``."""
    rng, better = np.random.default_rng(seed), rule(index)
    pool = np.union1d(pool, chosen)
    members, outer = np.searchsorted(pool, chosen), rows[pool]
    within = np.zeros(len(pool), dtype=bool)
    within[members] = True
    ratio = rows.shape[2] / len(chosen)
    wide, tight = min(0.9, _WIDE * ratio), min(0.9, _TIGHT * ratio**2)
    hot, cold = _HOT * ratio**2, _COLD * ratio**2
    look = max(_LOOK, _LOOK_EACH * len(chosen))
    best, best_value = members.copy(), np.nan
    for step in range(steps):
        share = step / steps
        table = Table(outer[members], Potential(index, wide * (tight / wide) ** share))
        value = float(better.of(np.sqrt(table.mu[::-1]), len(members)))
        if np.isnan(best_value) or better.better(value, best_value):
            best, best_value = members.copy(), value
        looked = rng.integers(0, len(pool), look)
        looked = looked[~within[looked]]
        if len(looked) == 0:
            continue
        out, into = _drawn(table.of(outer[looked]), hot * (cold / hot) ** share, rng)
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
