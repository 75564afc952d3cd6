"""Annealing by heat bath: swaps are scored exactly, one is drawn by its Boltzmann weight, none is ever rejected.

Few poses for many parameters make a rugged landscape (each pose is a thirtieth of the information), where descent alone
sticks. Scores are changes of the :mod:`.potential`, whose barriers tighten while the temperature falls. Each draw looks
at a random handful of the pool, since many candidates are near copies of each other. One reading a pose and an index
made of determinants (O2, O3, O4) are assumed: then the scores are exact.
"""

from dataclasses import dataclass

import numpy as np

from planner.common.determinism import Positions, on_one_thread, round_significant
from planner.common.errors import InputError
from planner.common.units import Array
from planner.design.observability.information import find_rule
from planner.design.selection.certificate import Certificate
from planner.design.selection.column_generation import certify_bound, price_core
from planner.design.selection.swap_scores import (
    BarrierPotential,
    SwapTable,
    best_swap_by_index,
    best_swap_by_potential,
    index_of_information,
    information_matrix,
    is_exact,
)

_LOOK, _LOOK_EACH = 100, 2  # candidates looked at in a draw: at least, and for each pose
_HOT, _COLD = 0.015, 0.0008  # times (parameters / poses)^2: relative change of the squared index
_WIDE, _TIGHT = 0.5, 0.25  # barrier strength, times that ratio and times its square: few poses make coarse swaps


def anneal(rows: Array, chosen: Positions, pool: Positions, index: str, steps: int, seed: int) -> Positions:
    """Return the best set met in ``steps`` swaps between ``chosen`` (n,) and ``pool`` (K,), candidates of ``rows``."""
    rng, better = np.random.default_rng(seed), find_rule(index)
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
        table = SwapTable(outer[members], BarrierPotential(index, wide * (tight / wide) ** share))
        value = float(better.of(np.sqrt(table.mu[::-1]), len(members)))
        if np.isnan(best_value) or better.better(value, best_value):
            best, best_value = members.copy(), value
        looked = rng.integers(0, len(pool), look)
        looked = looked[~within[looked]]
        if len(looked) == 0:
            continue
        out, into = _draw_swap(table.of(outer[looked]), hot * (cold / hot) ** share, rng)
        within[members[out]], within[looked[into]] = False, True
        members[out] = looked[into]
    return pool[best]


def _draw_swap(scores: Array, temperature: float, rng: np.random.Generator) -> tuple[int, int]:
    """Draw a pair with probability proportional to exp(score / temperature)."""
    scores -= np.max(scores)
    scores /= temperature
    total = np.cumsum(np.exp(scores, out=scores))
    place = min(int(np.searchsorted(total, rng.random() * total[-1])), len(total) - 1)
    out, into = divmod(place, scores.shape[1])
    return out, into


_EXCHANGE_WIDE = 2_000  # candidates that the descent looks at before it looks at all
_STRENGTHS = (0.1, 0.02, 0.003)
_KICKS = 8
_SWAPS = 2_000  # no descent was seen to take a tenth of it


@dataclass(frozen=True)
class PoseSelection:
    """``chosen`` candidates (n,), ascending, their index ``value`` and the certificate that bounds it, if asked for.

    ``gap``: how far, at most, the value is from the best possible choice among the candidates (a share; nan without).
    """

    chosen: Positions
    index: str
    value: float
    certificate: Certificate | None = None

    @property
    def gap(self) -> float:
        """Relative distance to the certified bound."""
        return find_rule(self.index).gap(self.value, self.certificate.value) if self.certificate else float("nan")


@on_one_thread
def exchange_poses(
    rows: Array,
    n: int,
    index: str = "O2",
    starts: int = 4,
    seed: int = 0,
    certificate: Certificate | None = None,
    steps: int = 3_000,
    width: int | None = None,
) -> PoseSelection:
    """Return the best set of ``n`` distinct candidates for ``index`` among ``starts`` searches. Deterministic.

    ``rows`` (N, r, P), reduced to identifiable columns. ``certificate``: the bound for this index and n if it is known
    already (its weights are the start and its prices the shortlist), else it is found first. ``steps`` of annealing in
    each start; the last descents look at the ``width`` candidates with the best prices (default: at all).

    Raises:
        InputError: fewer readings than parameters, or more poses than candidates.
    """
    if n * rows.shape[1] < rows.shape[2]:
        raise InputError(
            f"{n} poses give {n * rows.shape[1]} readings for {rows.shape[2]} parameters: "
            f"ask for at least {-(-rows.shape[2] // rows.shape[1])} poses"
        )
    certificate = certificate or certify_bound(rows, index, n, seed=seed)
    best: PoseSelection | None = None
    for turn in range(max(1, starts)):
        chosen = _run_start(rows, n, certificate, _SearchSettings(index, turn, seed, steps, width))
        value = index_of_information(index, information_matrix(rows[chosen]), n)
        if best is None or find_rule(index).better(float(value), best.value):
            best = PoseSelection(np.sort(chosen), index, float(value), certificate)
    assert best is not None
    return best


@dataclass(frozen=True)
class _SearchSettings:
    """What one start is told."""

    index: str
    turn: int
    seed: int
    steps: int
    width: int | None


def _run_start(rows: Array, n: int, certificate: Certificate, how: _SearchSettings) -> Positions:
    """One start: draw, anneal over the core, descend over the shortlist, polish over everything."""
    if n == len(rows):
        return np.arange(n)
    index = how.index
    order, near = price_core(rows, certificate, n)
    chosen = _draw_start(certificate, order, n, how.seed, how.turn)
    wide = np.sort(order[: max(_EXCHANGE_WIDE, 10 * n)])
    whole = np.arange(len(rows)) if how.width is None else np.sort(order[: max(how.width, 2 * n)])
    if index == "O1":
        return descend_swaps(rows, chosen, whole, BarrierPotential(index, 1.0))
    if is_exact(rows, BarrierPotential(index, 1.0)):
        chosen = anneal(rows, chosen, near, index, how.steps, how.seed + 7919 * how.turn)
        chosen = descend_swaps(rows, chosen, wide, BarrierPotential(index, _STRENGTHS[-1]))
    else:
        chosen = _iterate_descent(rows, chosen, near, wide, index, np.random.default_rng([how.seed, how.turn, 2]))
    return polish_by_index(rows, chosen, whole, index)


def _iterate_descent(
    rows: Array, chosen: Positions, near: Positions, wide: Positions, index: str, rng: np.random.Generator
) -> Positions:
    """Iterated descent, for scores that are not exact: throw out an eighth of the poses, descend, keep the better."""
    best = _tighten_descent(rows, chosen, wide, index)
    value = float(index_of_information(index, information_matrix(rows[best]), len(best)))
    for _ in range(_KICKS):
        count = max(1, len(best) // 8)
        fresh = rng.permutation(np.setdiff1d(near, best))[:count]
        trial = best.copy()
        trial[rng.permutation(len(best))[: len(fresh)]] = fresh
        trial = _tighten_descent(rows, trial, wide, index)
        new = float(index_of_information(index, information_matrix(rows[trial]), len(trial)))
        if find_rule(index).better(new, value):
            best, value = trial, new
    return best


def _tighten_descent(rows: Array, chosen: Positions, wide: Positions, index: str) -> Positions:
    for strength in _STRENGTHS:
        chosen = descend_swaps(rows, chosen, wide, BarrierPotential(index, strength))
    return chosen


def descend_swaps(
    rows: Array, chosen: Positions, pool: Positions, potential: BarrierPotential, group: Positions | None = None
) -> Positions:
    """Take the best swap by the potential until there is none; only within a group, where ``group`` (N,) is given."""
    for _ in range(_SWAPS):
        swap = best_swap_by_potential(rows, chosen, np.setdiff1d(pool, chosen), potential, group)
        if swap is None:
            break
        chosen = np.where(np.arange(len(chosen)) == swap.out, swap.into, chosen)
    return chosen


def polish_by_index(rows: Array, chosen: Positions, pool: Positions, index: str) -> Positions:
    """Take the best swap by the index itself, of those that tight and wide barriers single out, until there is none."""
    for _ in range(_SWAPS):
        outside = np.setdiff1d(pool, chosen)
        tries = (best_swap_by_index(rows, chosen, outside, BarrierPotential(index, each)) for each in _STRENGTHS[::-1])
        swap = next((each for each in tries if each), None)
        if swap is None:
            break
        chosen = np.where(np.arange(len(chosen)) == swap.out, swap.into, chosen)
    return chosen


def _draw_start(certificate: Certificate, order: Positions, n: int, seed: int, turn: int) -> Positions:
    """Take n of the support: the heaviest at the first turn, later drawn by weight; filled up by rank."""
    support, weights = certificate.support, certificate.weights
    if turn == 0:
        keys = round_significant(weights)
    else:  # Efraimidis and Spirakis 2006: weighted sampling without replacement
        keys = np.log(np.random.default_rng([seed, turn]).random(len(support))) / weights
    chosen = support[np.lexsort((support, -keys))[:n]]
    rest = order[~np.isin(order, chosen)]
    return np.concatenate([chosen, rest[: n - len(chosen)]]).astype(np.intp)
