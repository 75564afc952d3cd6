"""The search for the best set of poses, for any criterion: greedy, exchange one by one, best swaps, several starts.

A criterion is given in one of two forms. A *swap criterion* finds the best exchange of a chosen candidate for another.
A *sequential criterion* is kept up to date by low-rank updates while single candidates come and go. What is specific to
a criterion, such as the score of a swap or the update, is its own matter. The searches here are common to all.
"""

from collections.abc import Callable, Iterable, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from planner.common.determinism import Positions, first_maximum, round_significant
from planner.common.progress import UNLIMITED, LastStart, TimeLimit
from planner.common.units import Array


@dataclass(frozen=True)
class Swap:
    """Position ``out`` in the chosen set and candidate ``into`` that takes its place."""

    out: int
    into: int


class SwapCriterion(Protocol):
    """A criterion of a set with a fixed number of poses."""

    def best_swap(self, chosen: Positions, outside: Positions) -> Swap | None:
        """Return the swap of one of ``chosen`` for one of ``outside`` that betters it most; ``None`` if none does."""


class SequentialCriterion(Protocol):
    """A criterion that is kept up to date while candidates come and go."""

    def gains(self) -> Array:
        """How much each candidate would better the criterion if it came in, (N,)."""

    def change(self, candidate: int, sign: int = 1) -> None:
        """Add a candidate, or remove it where ``sign`` is −1; arrays are replaced, so that copies stay as they were."""


def descend(criterion: SwapCriterion, chosen: Positions, pool: Positions, limit: TimeLimit = UNLIMITED) -> Positions:
    """Take the best swap between ``chosen`` (n,) and the rest of ``pool`` until there is none."""
    for _ in range(2_000):  # swaps at most: no descent was seen to take a tenth of them
        if limit.must_stop(LastStart.CHOICE, "the search for the poses was cut short; the gap to the bound holds"):
            break
        swap = criterion.best_swap(chosen, np.setdiff1d(pool, chosen))
        if swap is None:
            break
        chosen = np.where(np.arange(len(chosen)) == swap.out, swap.into, chosen)
    return chosen


def search_starts(
    search: Callable[[int], tuple[Positions, float] | None],
    turns: Iterable[int],
    is_better: Callable[[float, float], bool],
) -> tuple[Positions, float]:
    """Return the best set of several starts, ascending, and its value; ``search`` may refuse a turn by ``None``."""
    best: tuple[Positions, float] | None = None
    for turn in turns:
        found = search(turn)
        if found is not None and (best is None or is_better(found[1], best[1])):
            best = found
    assert best is not None
    return np.sort(best[0]), best[1]


def add_greedily(
    criterion: SequentialCriterion, count: int, stop: Callable[[Sequence[int]], bool] | None = None
) -> Positions:
    """Add the candidate with the largest gain until there are ``count``, or ``stop`` says so; in that order."""
    chosen: list[int] = []
    while not (stop is not None and stop(chosen)) and len(chosen) < count:
        chosen.append(_best_addition(criterion.gains(), chosen))
        criterion.change(chosen[-1])
    return np.array(chosen, dtype=np.intp)


def exchange_singly(
    criterion: SequentialCriterion,
    chosen: Positions,
    passes: int,
    order: Callable[[Positions], Iterable[int]] = lambda chosen: range(len(chosen)),
    limit: TimeLimit = UNLIMITED,
) -> Positions:
    """Remove each of ``chosen`` in turn and add the best candidate in its place, in ``passes`` or until none changes.

    ``order`` gives the positions in the chosen set in the order of a pass.
    """
    out = chosen.copy()
    for _ in range(passes):
        before = out.copy()
        for k in order(out):
            if limit.must_stop(LastStart.CHOICE, "the search for the poses was cut short; the gap to the bound holds"):
                return out
            kept = copy(criterion)
            criterion.change(int(out[k]), -1)
            gains = criterion.gains()
            best = _best_addition(gains, np.delete(out, k))
            if gains[best] > gains[out[k]] * (1 + 1e-9):  # relative gain below which an exchange is rounding
                out[k] = best
                criterion.change(best)
            else:
                vars(criterion).update(vars(kept))
        if np.array_equal(out, before):
            break
    return out


def _best_addition(gains: Array, taken: Sequence[int] | Positions) -> int:
    gains[taken] = -np.inf
    return first_maximum(gains)


def order_by_weight(support: Positions, weights: Array, seed: int, turn: int) -> Positions:
    """Order a relaxation's candidates: the heaviest first at turn 0, later at random, by weight."""
    if turn == 0:
        keys = round_significant(weights)
    else:  # Efraimidis and Spirakis 2006: weighted sampling without replacement
        keys = np.log(np.random.default_rng([seed, turn]).random(len(support))) / weights
    return support[np.lexsort((support, -keys))]


def highest_priced_candidates(prices: Array, count: int) -> Positions:
    """Return the ``count`` candidates with the highest prices, ascending."""
    return np.sort(np.lexsort((np.arange(len(prices)), -round_significant(prices)))[:count])
