"""Exchange of poses for any index: from the relaxation's weights, annealed, then down to where no swap helps."""

from dataclasses import dataclass

import numpy as np

from planner.common.determinism import Positions, on_one_thread
from planner.common.errors import InputError
from planner.common.units import Array
from planner.design.observability.information import find_rule
from planner.design.selection.annealing import anneal
from planner.design.selection.certificate import Certificate
from planner.design.selection.index_bound import certify_bound, price_core
from planner.design.selection.index_criterion import (
    STRENGTHS,
    BarrierPotential,
    IndexCriterion,
    PotentialCriterion,
    index_of_rows,
    is_exact,
)
from planner.design.selection.search import descend, order_by_weight, search_starts

_SHORTLIST = 2_000  # candidates that the descent looks at before it looks at all
_KICKS = 8


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
    starts: int | None = None,
    seed: int = 0,
    certificate: Certificate | None = None,
    steps: int = 12_000,
    width: int | None = None,
) -> PoseSelection:
    """Return the best set of ``n`` distinct candidates for ``index`` among ``starts`` searches. Deterministic.

    ``rows`` (N, r, P), reduced to identifiable columns. ``certificate``: the bound for this index and n if it is known
    already (its weights are the start and its prices the shortlist), else it is found first. ``steps`` of annealing in
    each start; ``starts``: one by default, four where nothing is annealed; the last descents look at the ``width``
    candidates with the best prices (default: at all).

    Raises:
        InputError: fewer readings than parameters, or more poses than candidates.
    """
    if n * rows.shape[1] < rows.shape[2]:
        raise InputError(
            f"{n} poses give {n * rows.shape[1]} readings for {rows.shape[2]} parameters: "
            f"ask for at least {-(-rows.shape[2] // rows.shape[1])} poses"
        )
    certificate = certificate or certify_bound(rows, index, n, seed=seed)
    search = _IndexSearch(rows, n, index, certificate, seed, steps, width)
    starts = starts or (1 if search.anneals else 4)
    chosen, value = search_starts(search.run, range(starts), find_rule(index).better)
    return PoseSelection(chosen, index, value, certificate)


@dataclass(frozen=True)
class _IndexSearch:
    """The search from several starts; attributes as the arguments of :func:`exchange_poses`."""

    rows: Array
    n: int
    index: str
    certificate: Certificate
    seed: int
    steps: int
    width: int | None

    @property
    def anneals(self) -> bool:
        """Whether each start anneals; else it only descends."""
        return self.index != "O1" and is_exact(self.rows, self.index)

    def run(self, turn: int) -> tuple[Positions, float]:
        """One start: draw, anneal over the core, descend over the shortlist, polish over everything."""
        chosen = np.arange(self.n) if self.n == len(self.rows) else self._search_from(turn)
        return chosen, index_of_rows(self.index, self.rows[chosen])

    def _search_from(self, turn: int) -> Positions:
        rows, n, index = self.rows, self.n, self.index
        order, near = price_core(rows, self.certificate, n)
        support = order_by_weight(self.certificate.support, self.certificate.weights, self.seed, turn)[:n]
        rest = order[~np.isin(order, support)]  # fills up by rank
        chosen = np.concatenate([support, rest[: n - len(support)]]).astype(np.intp)
        short = np.sort(order[: max(_SHORTLIST, 10 * n)])
        whole = np.arange(len(rows)) if self.width is None else np.sort(order[: max(self.width, 2 * n)])
        if index == "O1":
            return descend(PotentialCriterion(rows, BarrierPotential(index, 1.0)), chosen, whole)
        if self.anneals:
            chosen = anneal(rows, chosen, near, index, self.steps, self.seed + 7919 * turn)
            chosen = self._tighten(chosen, short, STRENGTHS[-1:])
        else:
            chosen = self._iterate(chosen, near, short, np.random.default_rng([self.seed, turn, 2]))
        return descend(IndexCriterion(rows, index), chosen, whole)

    def _iterate(self, chosen: Positions, near: Positions, short: Positions, rng: np.random.Generator) -> Positions:
        """Iterated descent, for scores that are not exact: throw out an eighth, descend, keep the better."""
        best = self._tighten(chosen, short)
        value = index_of_rows(self.index, self.rows[best])
        for _ in range(_KICKS):
            count = max(1, len(best) // 8)
            fresh = rng.permutation(np.setdiff1d(near, best))[:count]
            trial = best.copy()
            trial[rng.permutation(len(best))[: len(fresh)]] = fresh
            trial = self._tighten(trial, short)
            new = index_of_rows(self.index, self.rows[trial])
            if find_rule(self.index).better(new, value):
                best, value = trial, new
        return best

    def _tighten(self, chosen: Positions, short: Positions, strengths: tuple[float, ...] = STRENGTHS) -> Positions:
        for strength in strengths:
            chosen = descend(PotentialCriterion(self.rows, BarrierPotential(self.index, strength)), chosen, short)
        return chosen
