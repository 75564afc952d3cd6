"""Exchange of poses for any index: from the relaxation's weights, annealed, then down to where no swap helps."""

from dataclasses import dataclass

import numpy as np

from planner.errors import InputError
from planner.observability import rule
from planner.repeatable import Places, canonical, single_threaded
from planner.units import Array

from .annealing import anneal
from .bounds import bound, core
from .certificate import Certificate
from .potential import Potential
from .swaps import best_by_index, best_by_potential, exact, index_of, information

_WIDE = 2_000  # candidates that the descent looks at before it looks at all
_STRENGTHS = (0.1, 0.02, 0.003)
_KICKS = 8
_SWAPS = 2_000  # no descent was seen to take a tenth of it


@dataclass(frozen=True)
class Selection:
    """``chosen`` candidates (n,), ascending, their index ``value`` and the certificate that bounds it, if asked for.

    ``gap``: how far, at most, the value is from the best possible choice among the candidates (a share; nan without).
    """

    chosen: Places
    index: str
    value: float
    certificate: Certificate | None = None

    @property
    def gap(self) -> float:
        """Relative distance to the certified bound."""
        return rule(self.index).gap(self.value, self.certificate.value) if self.certificate else float("nan")


@single_threaded
def exchange(
    rows: Array,
    n: int,
    index: str = "O2",
    starts: int = 4,
    seed: int = 0,
    certificate: Certificate | None = None,
    steps: int = 3_000,
    width: int | None = None,
) -> Selection:
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
    certificate = certificate or bound(rows, index, n, seed=seed)
    best: Selection | None = None
    for turn in range(max(1, starts)):
        chosen = _searched(rows, n, certificate, _Search(index, turn, seed, steps, width))
        value = index_of(index, information(rows[chosen]), n)
        if best is None or rule(index).better(float(value), best.value):
            best = Selection(np.sort(chosen), index, float(value), certificate)
    assert best is not None
    return best


@dataclass(frozen=True)
class _Search:
    """What one start is told."""

    index: str
    turn: int
    seed: int
    steps: int
    width: int | None


def _searched(rows: Array, n: int, certificate: Certificate, how: _Search) -> Places:
    """One start: draw, anneal over the core, descend over the shortlist, polish over everything."""
    if n == len(rows):
        return np.arange(n)
    index = how.index
    order, near = core(rows, certificate, n)
    chosen = _drawn(certificate, order, n, how.seed, how.turn)
    wide = np.sort(order[: max(_WIDE, 10 * n)])
    whole = np.arange(len(rows)) if how.width is None else np.sort(order[: max(how.width, 2 * n)])
    if index == "O1":
        return descend(rows, chosen, whole, Potential(index, 1.0))
    if exact(rows, Potential(index, 1.0)):
        chosen = anneal(rows, chosen, near, index, how.steps, how.seed + 7919 * how.turn)
        chosen = descend(rows, chosen, wide, Potential(index, _STRENGTHS[-1]))
    else:
        chosen = _kicked(rows, chosen, near, wide, index, np.random.default_rng([how.seed, how.turn, 2]))
    return polish(rows, chosen, whole, index)


def _kicked(rows: Array, chosen: Places, near: Places, wide: Places, index: str, rng: np.random.Generator) -> Places:
    """Iterated descent, for scores that are not exact: throw out an eighth of the poses, descend, keep the better."""
    best = _down(rows, chosen, wide, index)
    value = float(index_of(index, information(rows[best]), len(best)))
    for _ in range(_KICKS):
        count = max(1, len(best) // 8)
        fresh = rng.permutation(np.setdiff1d(near, best))[:count]
        trial = best.copy()
        trial[rng.permutation(len(best))[: len(fresh)]] = fresh
        trial = _down(rows, trial, wide, index)
        new = float(index_of(index, information(rows[trial]), len(trial)))
        if rule(index).better(new, value):
            best, value = trial, new
    return best


def _down(rows: Array, chosen: Places, wide: Places, index: str) -> Places:
    for strength in _STRENGTHS:
        chosen = descend(rows, chosen, wide, Potential(index, strength))
    return chosen


def descend(rows: Array, chosen: Places, pool: Places, potential: Potential, group: Places | None = None) -> Places:
    """Take the best swap by the potential until there is none; only within a group, where ``group`` (N,) is given."""
    for _ in range(_SWAPS):
        swap = best_by_potential(rows, chosen, np.setdiff1d(pool, chosen), potential, group)
        if swap is None:
            break
        chosen = np.where(np.arange(len(chosen)) == swap.out, swap.into, chosen)
    return chosen


def polish(rows: Array, chosen: Places, pool: Places, index: str) -> Places:
    """Take the best swap by the index itself, of those that tight and wide barriers single out, until there is none."""
    for _ in range(_SWAPS):
        outside = np.setdiff1d(pool, chosen)
        tries = (best_by_index(rows, chosen, outside, Potential(index, each)) for each in _STRENGTHS[::-1])
        swap = next((each for each in tries if each), None)
        if swap is None:
            break
        chosen = np.where(np.arange(len(chosen)) == swap.out, swap.into, chosen)
    return chosen


def _drawn(certificate: Certificate, order: Places, n: int, seed: int, turn: int) -> Places:
    """Take n of the support: the heaviest at the first turn, later drawn by weight; filled up by rank."""
    support, weights = certificate.support, certificate.weights
    if turn == 0:
        keys = canonical(weights)
    else:  # Efraimidis and Spirakis 2006: weighted sampling without replacement
        keys = np.log(np.random.default_rng([seed, turn]).random(len(support))) / weights
    chosen = support[np.lexsort((support, -keys))[:n]]
    rest = order[~np.isin(order, chosen)]
    return np.concatenate([chosen, rest[: n - len(chosen)]]).astype(np.intp)
