"""The index against the number of poses, its certified bound and bend, computed beside other work."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from planner.common.determinism import Positions, on_one_thread
from planner.common.errors import InputError
from planner.common.progress import UNLIMITED, TimeLimit
from planner.common.second_process import ForkedTask
from planner.common.units import Array
from planner.design.observability.information import find_rule
from planner.design.selection.certificate import Certificate
from planner.design.selection.index_bound import certify_bound
from planner.design.selection.index_search import PoseSelection, exchange_poses


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
