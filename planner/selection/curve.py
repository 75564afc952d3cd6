"""The index against the number of poses, with the certified bound drawn in, and the number where the curve bends."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.errors import InputError
from planner.observability import rule
from planner.repeatable import Places, single_threaded
from planner.units import Array, frozen

from .bounds import bound
from .certificate import Certificate
from .exchange import Selection, exchange

_TOLERANCE = 5e-3
_WIDTH = 4_000  # candidates by price: further down no swap was seen to help


@dataclass(frozen=True)
class IndexCurve:
    """``sizes`` (k,), ``values`` (k,) reached and ``bounds`` (k,) proven for sets of each size; the sets themselves."""

    index: str
    sizes: Places
    values: Array
    bounds: Array
    selections: tuple[Selection, ...]

    @property
    def knee(self) -> int:
        """The number of poses where the curve bends (see :func:`knee`)."""
        return knee(self.sizes, self.values, self.index)

    def joined(self, other: "IndexCurve") -> "IndexCurve":
        """Return the curve over the sizes of both."""
        order = np.argsort(np.concatenate([self.sizes, other.sizes]))
        sets = (*self.selections, *other.selections)
        return IndexCurve(
            self.index,
            np.concatenate([self.sizes, other.sizes])[order],
            frozen(np.concatenate([self.values, other.values])[order]),
            frozen(np.concatenate([self.bounds, other.bounds])[order]),
            tuple(sets[int(k)] for k in order),
        )


@single_threaded
def index_curve(rows: Array, sizes: Sequence[int], index: str = "O2", seed: int = 0, steps: int = 400) -> IndexCurve:
    """Return the index reached and its bound for each number of poses in ``sizes``.

    ``rows`` (N, r, P) reduced to identifiable columns. Each bound starts from the support of the one before and is
    verified over all candidates.

    Raises:
        InputError: a size below the number of parameters or above the number of candidates.
    """
    found: list[Selection] = []
    before: Certificate | None = None
    for n in sorted(set(sizes)):
        before = bound(rows, index, n, tolerance=_TOLERANCE, seed=seed, near=before)
        found.append(exchange(rows, n, index, starts=1, seed=seed, certificate=before, steps=steps, width=_WIDTH))
    bounds = [each.certificate.value for each in found if each.certificate]
    return IndexCurve(
        index,
        np.array(sorted(set(sizes))),
        frozen([each.value for each in found]),
        frozen(bounds),
        tuple(found),
    )


def knee(sizes: Sequence[int] | Places, values: Sequence[float] | Array, index: str = "O2") -> int:
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
    height = np.log(v[order]) * (1.0 if rule(index).maximise else -1.0)
    height, width = np.maximum.accumulate(height), np.log(n[order])
    if height[-1] <= height[0]:
        return int(n[order][0])
    x = (width - width[0]) / (width[-1] - width[0])
    y = (height - height[0]) / (height[-1] - height[0])
    return int(n[order][int(np.argmax(np.round(y - x, 9)))])
