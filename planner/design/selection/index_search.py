"""Exchange of poses for any index: from the relaxation's weights, annealed, then down to where no swap helps.

The index against the number of poses, its certified bound and bend, computed beside other work.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from planner.common.determinism import Positions, on_one_thread
from planner.common.errors import InputError
from planner.common.progress import UNLIMITED, LastStart, TimeLimit
from planner.common.second_process import ForkedTask
from planner.common.units import Array
from planner.design.observability.information import find_rule
from planner.design.selection.certificate import Certificate
from planner.design.selection.index_bound import certify_bound, price_candidates
from planner.design.selection.index_criterion import (
    BARRIER_STRENGTHS,
    BarrierPotential,
    IndexCriterion,
    PotentialCriterion,
    index_of_rows,
    is_exact,
)
from planner.design.selection.search import descend, order_by_weight, search_starts

# chosen poses that one draw of the annealing may swap: on 200 poses of the UR10 as good a set as with all of them
DRAWN_MEMBERS = 100


def anneal(
    rows: Array, chosen: Positions, pool: Positions, index: str, steps: int, seed: int, limit: TimeLimit = UNLIMITED
) -> Positions:
    """Return the best set met in ``steps`` swaps between ``chosen`` (n,) and ``pool`` (K,), candidates of ``rows``."""
    block = 256  # draws whose candidates are drawn together
    rng, better = np.random.default_rng(seed), find_rule(index)
    pool = np.union1d(pool, chosen)
    members, outer = np.searchsorted(pool, chosen), np.ascontiguousarray(rows[pool, 0])
    within = np.zeros(len(pool), dtype=bool)
    within[members] = True
    ratio = rows.shape[2] / len(chosen)
    wide, tight = min(0.9, 0.5 * ratio), min(0.9, 0.25 * ratio**2)  # barrier strengths: few poses make coarse swaps
    # temperature at first and at last: a relative change of the squared index
    hot, cold = 0.015 * ratio**2, 0.0008 * ratio**2
    look = max(100, 2 * min(len(chosen), DRAWN_MEMBERS))  # candidates looked at in a draw
    best, best_value = members.copy(), np.nan
    for step in range(steps):
        share = step / steps
        if step % block == 0:
            if limit.must_stop(LastStart.CHOICE, "the search for the poses was cut short; the gap to the bound holds"):
                break
            candidates = rng.integers(0, len(pool), (block, look))
        if step % 4 == 0:  # draws with the barriers where they are
            bath = _HeatBath(outer[members], BarrierPotential(index, wide * (tight / wide) ** share))
            value = float(better.of(np.sqrt(bath.mu[::-1]), len(members)))
            if np.isnan(best_value) or better.is_better(value, best_value):
                best, best_value = members.copy(), value
        looked = candidates[step % block]
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
        """Draw a swap with probability proportional to exp(score / temperature): its row of inner, and of ``outer``.

        Where many are chosen, it is one of some of them, drawn anew each time: the chain keeps its distribution, and a
        draw costs the same for any number of poses.
        """
        if len(self.inner) <= DRAWN_MEMBERS:
            return self._draw_of(self.inner, outer, temperature, rng)
        some = rng.choice(len(self.inner), DRAWN_MEMBERS, replace=False)
        out, into = self._draw_of(self.inner[some], outer, temperature, rng)
        return int(some[out]), into

    def _draw_of(self, inner: Array, outer: Array, temperature: float, rng: np.random.Generator) -> tuple[int, int]:
        """Draw a swap as :meth:`draw` does, of one of ``inner`` (n, P)."""
        half = inner @ self.resolvents
        ratio = half.reshape(-1, half.shape[2]) @ outer.T
        ratio *= ratio
        ratio = ratio.reshape(len(half), len(inner), len(outer))
        stay = 1.0 - np.einsum("bnp,np->bn", half, inner)
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
    limit: TimeLimit = UNLIMITED,
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
    certificate = certificate or certify_bound(rows, index, n, seed=seed, limit=limit)
    search = _IndexSearch(rows, n, index, certificate, seed, steps, width, limit)
    starts = starts or (1 if search.anneals else 4)
    chosen, value = search_starts(search.run, range(starts), find_rule(index).is_better)
    return PoseSelection(chosen, index, value, certificate)


def improve_poses(rows: Array, chosen: Positions, index: str) -> Positions:
    """Return the set that exchanges of one pose at a time lead to from ``chosen`` (n,), over all candidates.

    ``rows`` (N, r, P), reduced to identifiable columns. Without a bound: quick, for many sets that are compared.
    """
    whole = np.arange(len(rows))
    for strength in (1.0,) if index == "O1" else BARRIER_STRENGTHS:
        chosen = descend(PotentialCriterion(rows, BarrierPotential(index, strength)), chosen, whole, UNLIMITED)
    return chosen if index == "O1" else descend(IndexCriterion(rows, index), chosen, whole, UNLIMITED)


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
    limit: TimeLimit

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
        order, near = price_candidates(rows, self.certificate, n)
        support = order_by_weight(self.certificate.support, self.certificate.weights, self.seed, turn)[:n]
        rest = order[~np.isin(order, support)]  # fills up by rank
        chosen = np.concatenate([support, rest[: n - len(support)]]).astype(np.intp)
        short = np.sort(order[: max(2_000, 10 * n)])  # the descent looks at these before it looks at all
        whole = np.arange(len(rows)) if self.width is None else np.sort(order[: max(self.width, 2 * n)])
        if index == "O1":
            return descend(PotentialCriterion(rows, BarrierPotential(index, 1.0)), chosen, whole, self.limit)
        if self.anneals:
            chosen = anneal(rows, chosen, near, index, self.steps, self.seed + 7919 * turn, self.limit)
            chosen = self._tighten(chosen, short, BARRIER_STRENGTHS[-1:])
        else:
            chosen = self._iterate(chosen, near, short, np.random.default_rng([self.seed, turn, 2]))
        return descend(IndexCriterion(rows, index), chosen, whole, self.limit)

    def _iterate(self, chosen: Positions, near: Positions, short: Positions, rng: np.random.Generator) -> Positions:
        """Iterated descent, for scores that are not exact: throw out an eighth, descend, keep the better."""
        best = self._tighten(chosen, short)
        value = index_of_rows(self.index, self.rows[best])
        for _ in range(8):  # kicks
            count = max(1, len(best) // 8)
            fresh = rng.permutation(np.setdiff1d(near, best))[:count]
            trial = best.copy()
            trial[rng.permutation(len(best))[: len(fresh)]] = fresh
            trial = self._tighten(trial, short)
            new = index_of_rows(self.index, self.rows[trial])
            if find_rule(self.index).is_better(new, value):
                best, value = trial, new
        return best

    def _tighten(
        self, chosen: Positions, short: Positions, strengths: tuple[float, ...] = BARRIER_STRENGTHS
    ) -> Positions:
        for strength in strengths:
            criterion = PotentialCriterion(self.rows, BarrierPotential(self.index, strength))
            chosen = descend(criterion, chosen, short, self.limit)
        return chosen


@dataclass(frozen=True)
class IndexCurve:
    """The best set found for each number of poses, ascending, and what is proven of sets of that size."""

    index: str
    selections: tuple[PoseSelection, ...]

    @property
    def sizes(self) -> Positions:
        """Numbers of poses, (k,)."""
        return np.array([len(each.chosen) for each in self.selections])

    @property
    def values(self) -> Array:
        """The index that is reached with each, (k,)."""
        return np.array([each.value for each in self.selections])

    @property
    def bounds(self) -> Array:
        """Bounds of the index over all sets of each size, (k,)."""
        return np.array([each.certificate.value for each in self.selections if each.certificate])

    @property
    def knee(self) -> int:
        """The number of poses where the curve bends (see :func:`find_knee`)."""
        return find_knee(self.sizes, self.values, self.index)

    def certificate(self, size: int) -> Certificate | None:
        """The certificate of the size nearest to ``size``."""
        return self.selections[int(np.argmin(np.abs(self.sizes - size)))].certificate

    def merge(self, other: "IndexCurve") -> "IndexCurve":
        """Return the curve over the sizes of both."""
        sets = sorted((*self.selections, *other.selections), key=lambda each: len(each.chosen))
        return IndexCurve(self.index, tuple(sets))


@on_one_thread
def compute_index_curve(
    rows: Array,
    sizes: Sequence[int],
    index: str = "O2",
    seed: int = 0,
    steps: int = 400,
    near: Certificate | None = None,
    limit: TimeLimit = UNLIMITED,
) -> IndexCurve:
    """Return the index reached and its bound for each number of poses in ``sizes``.

    ``rows`` (N, r, P) reduced to identifiable columns. Each bound starts from the support of the one before, the first
    from ``near``, and is verified over all candidates.

    Raises:
        InputError: a size below the number of parameters or above the number of candidates.
    """
    found: list[PoseSelection] = []
    before = near
    for n in sorted(set(sizes)):
        # 5e-3: [1] gap of the bound: a curve needs no more
        before = certify_bound(rows, index, n, tolerance=5e-3, seed=seed, near=before, limit=limit)
        found.append(exchange_poses(rows, n, index, 1, seed, before, steps, width=4_000, limit=limit))
    return IndexCurve(index, tuple(found))


def find_knee(sizes: Sequence[int] | Positions, values: Sequence[float] | Array, index: str = "O2") -> int:
    """Return the number of poses where the curve bends.

    The rule: take the curve on logarithmic axes (twice the poses, how many per cent better?), made monotone from the
    left so that search noise cannot bend it, scale both ranges to one and take the size furthest from the chord between
    the ends (Satopaa et al. 2011, "kneedle"; ties to fewer poses).

    Raises:
        InputError: fewer than three sizes, or not as many values.
    """
    n, v = np.asarray(sizes, dtype=float), np.asarray(values, dtype=float)
    if len(n) < 3 or len(n) != len(v):
        raise InputError(f"a bend needs at least three sizes with a value each, not {len(n)} and {len(v)}")
    order = np.argsort(n)
    height = find_rule(index).merit(np.log(v[order]))
    height, width = np.maximum.accumulate(height), np.log(n[order])
    if height[-1] <= height[0]:
        return int(n[order][0])
    x = (width - width[0]) / (width[-1] - width[0])
    y = (height - height[0]) / (height[-1] - height[0])
    return int(n[order][int(np.argmax(np.round(y - x, 9)))])


class BackgroundCurve(ForkedTask[IndexCurve]):
    """Computes :func:`compute_index_curve` on another processor; the context ends that if its caller fails.

    Args:
        rows: of the candidates, (N, r, P), reduced to identifiable columns.
        sizes: numbers of poses.
        index: name of the index.
        seed: of the searches.
        near: a certificate for another number of poses, where the bounds begin.
        help_out: whoever waits for the curve has nothing else to do: it computes every other size itself.
        limit: of the time that a plan may take.
    """

    def __init__(
        self,
        rows: Array,
        sizes: Sequence[int],
        index: str,
        seed: int,
        near: Certificate | None = None,
        help_out: bool = False,
        limit: TimeLimit = UNLIMITED,
    ) -> None:
        self._compute = partial(compute_index_curve, rows, index=index, seed=seed, near=near, limit=limit)
        self._own = list(sizes)[1::2] if help_out else []
        super().__init__(partial(self._compute, [n for n in sizes if n not in self._own]))

    def result(self) -> IndexCurve:
        """Wait for the curve, and return it."""
        return self._curve

    @cached_property
    def _curve(self) -> IndexCurve:
        mine = self._compute(self._own) if self._own else None
        curve = super().result()
        return curve if mine is None else curve.merge(mine)
