"""Annealing of a set of poses by heat bath: swaps are scored exactly, one is drawn by its Boltzmann weight.

No draw is ever rejected. Few poses for many parameters make a rugged landscape (each pose is a thirtieth of the
information), where descent alone sticks. Scores are changes of the barrier potential, whose barriers tighten while the
temperature falls. Each draw looks at a random handful of the pool, since many candidates are near copies of each other.
One reading a pose and an index made of determinants (O2, O3, O4) are assumed: then the scores are exact.
"""

import numpy as np

from planner.common.determinism import Positions
from planner.common.time_limit import CHOICE, must_stop
from planner.common.units import Array
from planner.design.observability.information import find_rule
from planner.design.selection.index_criterion import BarrierPotential

_HELD = 4  # draws with the barriers where they are
_LOOK, _LOOK_EACH = 100, 2  # candidates looked at in a draw: at least, and for each pose
_BLOCK = 256  # draws whose candidates are drawn together
_HOT, _COLD = 0.015, 0.0008  # times (parameters / poses)^2: relative change of the squared index
_WIDE, _TIGHT = 0.5, 0.25  # barrier strength, times that ratio and times its square: few poses make coarse swaps


def anneal(rows: Array, chosen: Positions, pool: Positions, index: str, steps: int, seed: int) -> Positions:
    """Return the best set met in ``steps`` swaps between ``chosen`` (n,) and ``pool`` (K,), candidates of ``rows``."""
    rng, better = np.random.default_rng(seed), find_rule(index)
    pool = np.union1d(pool, chosen)
    members, outer = np.searchsorted(pool, chosen), np.ascontiguousarray(rows[pool, 0])
    within = np.zeros(len(pool), dtype=bool)
    within[members] = True
    ratio = rows.shape[2] / len(chosen)
    wide, tight = min(0.9, _WIDE * ratio), min(0.9, _TIGHT * ratio**2)
    hot, cold = _HOT * ratio**2, _COLD * ratio**2
    look = max(_LOOK, _LOOK_EACH * len(chosen))
    best, best_value = members.copy(), np.nan
    for step in range(steps):
        share = step / steps
        if step % _BLOCK == 0:
            if must_stop(CHOICE, "the search for the poses was cut short; the gap to the bound holds"):
                break
            candidates = rng.integers(0, len(pool), (_BLOCK, look))
        if step % _HELD == 0:
            bath = _HeatBath(outer[members], BarrierPotential(index, wide * (tight / wide) ** share))
            value = float(better.of(np.sqrt(bath.mu[::-1]), len(members)))
            if np.isnan(best_value) or better.better(value, best_value):
                best, best_value = members.copy(), value
        looked = candidates[step % _BLOCK]
        looked = looked[~within[looked]]
        if len(looked) == 0:
            continue
        out, into = bath.draw(outer[looked], hot * (cold / hot) ** share, rng)
        within[members[out]], within[looked[into]] = False, True
        members[out] = looked[into]
        bath.exchange(out, outer[members[out]])
    return pool[best]


class _HeatBath:
    """Scores of swaps out of one chosen set ``inner`` (n, P), by barriers that are held where they are.

    Each barrier is a resolvent (M - s I)^-1, its shift s below or above all eigenvalues; a swap of u for v multiplies
    its determinant by (1 + v'Rv)(1 - u'Ru) + (u'Rv)^2. Logarithms and weights have single precision: a draw needs no
    more.
    """

    def __init__(self, inner: Array, potential: BarrierPotential) -> None:
        self.inner = inner
        self.mu, axes = np.linalg.eigh(inner.T @ inner)
        shifts = [s for s in potential.shifts(self.mu) if np.isfinite(s)]
        self.resolvents = np.array([(axes / (self.mu - s)) @ axes.T for s in shifts])
        self.weights = potential.weights(inner.shape[1])[: len(shifts)]

    def draw(self, outer: Array, temperature: float, rng: np.random.Generator) -> tuple[int, int]:
        """Draw a swap with probability proportional to exp(score / temperature): its row of inner, and of ``outer``."""
        half = self.inner @ self.resolvents
        ratio = half.reshape(-1, half.shape[2]) @ outer.T
        ratio *= ratio
        ratio = ratio.reshape(len(half), len(self.inner), len(outer))
        stay = 1.0 - np.einsum("bnp,np->bn", half, self.inner)
        come = 1.0 + np.einsum("bmp,mp->bm", outer @ self.resolvents, outer)
        ratio += stay[:, :, None] * come[:, None, :]
        parts = np.log(np.maximum(ratio, 1e-30, out=ratio).astype(np.float32))
        scores = parts[0] * np.float32(self.weights[0] / temperature)
        for part, weight in zip(parts[1:], self.weights[1:], strict=True):
            scores += part * np.float32(weight / temperature)
        scores -= scores.max()
        weights = np.exp(scores, out=scores)
        out = _draw_place(weights.sum(axis=1, dtype=float), rng)
        return out, _draw_place(weights[out].astype(float), rng)

    def exchange(self, position: int, row: Array) -> None:
        """Take ``row`` (P,) for the chosen one at ``position`` (Sherman, Morrison, Woodbury)."""
        come, leave = self.resolvents @ row, self.resolvents @ self.inner[position]  # (barriers, P)
        a, b, c = 1.0 + come @ row, come @ self.inner[position], leave @ self.inner[position] - 1.0
        scale = 1.0 / (a * c - b * b)
        left = (c * scale)[:, None] * come - (b * scale)[:, None] * leave
        right = (a * scale)[:, None] * leave - (b * scale)[:, None] * come
        self.resolvents -= left[:, :, None] * come[:, None] + right[:, :, None] * leave[:, None]
        self.inner[position] = row


def _draw_place(weights: Array, rng: np.random.Generator) -> int:
    total = weights.cumsum()
    return min(int(total.searchsorted(rng.random() * total[-1])), len(total) - 1)
