"""What the readings tell of each family of columns, kept up to date while sizes of families change.

With C the covariance of the readings a change needs XᵀC⁻¹X of all columns X and XᵀC⁻¹y, and no reading. Changes wait as
the directions by which they lower the former, until there are many: one product of matrices then takes a fraction of
the time of one after the other. Whoever asks for a family has those that wait taken out of its block.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, Self

import numpy as np
from scipy.linalg.blas import dsyrk

from planner.common.units import Array

LEAST_LEFT_SHARE = 1e-12  # of a direction's variance that the readings leave
MOST_WAITING = 64  # directions of changes that wait: a product with so many is as quick as the processor can


@dataclass(frozen=True)
class FamilyBlock:
    """A family in the axes (k, k) in which XᵀC⁻¹X is diagonal: its number, the diagonal and XᵀC⁻¹y, (k,) each."""

    family: int
    axes: Array
    values: Array
    toward: Array

    def gains(self, more: Array) -> Array:
        """Return the growth (v,) of the log density with ``more`` variances (v,) of the columns."""
        grown = np.maximum(1 + more[:, None] * self.values, LEAST_LEFT_SHARE)
        return np.asarray(0.5 * (more[:, None] * self.toward**2 / grown - np.log(grown)).sum(axis=1))


def padded_width(columns: int) -> int:
    """Return 2ᵏ, or 3·2ᵏ of many, not below a number of columns: families of about as many are looked at together."""
    power = 1 << (columns - 1).bit_length()
    return max(2, power) if columns <= 16 or 4 * columns > 3 * power else 3 * power // 4


@dataclass
class _SameWidth:
    """Families of up to k columns each; of those that have fewer the last ones are nought.

    ``at`` (f, k) int: where these stand; ``grams`` (f, k, k): of every family XᵀC⁻¹X, without the changes that wait but
    the first ``taken``.
    """

    at: np.ndarray
    grams: Array
    taken: int = 0

    def take(self, waiting: Array, signs: Array) -> None:
        """Take out the changes that wait (r, q), of signs (r,)."""
        if self.taken < len(signs):
            each = waiting[self.taken :].T[self.at]
            self.grams -= each * signs[self.taken :] @ each.transpose(0, 2, 1)
            self.taken = len(signs)


class Products(Protocol):
    """XᵀC⁻¹X of all columns X and, the last, of the readings, before changes that wait."""

    @property
    def toward(self) -> Array:
        """Products of all with the readings, (q + 1,)."""
        ...

    def block(self, own: slice) -> Array:
        """Return the products of some columns with each other, (k, k)."""
        ...

    def rows(self, own: slice) -> Array:
        """Return the products of some columns with all, (k, q + 1)."""
        ...

    def take_out(self, waiting: Array, signs: Array) -> None:
        """Take out changes that waited (r, q + 1), of signs (r,)."""
        ...


@dataclass
class WholeProducts:
    """All products at once, their lower triangle (q + 1, q + 1), with noughts above it; changed in place."""

    whole: Array

    @property
    def toward(self) -> Array:
        """See :class:`Products`."""
        return np.asarray(self.whole[-1])

    def block(self, own: slice) -> Array:
        """See :class:`Products`."""
        return _symmetric(self.whole[own, own])

    def rows(self, own: slice) -> Array:
        """See :class:`Products`."""
        out = self.whole[own] + self.whole[:, own].T  # of both triangles, one of which is nought
        np.einsum("kk->k", out[:, own])[:] *= 0.5
        return np.asarray(out)

    def take_out(self, waiting: Array, signs: Array) -> None:
        """See :class:`Products`."""
        for sign in (1.0, -1.0):
            own = waiting[signs == sign]
            if len(own):
                dsyrk(-sign, own.T, 1.0, self.whole, lower=1, overwrite_c=1)


@dataclass
class FewProducts:
    """Products of the families that are asked for: where few act, most never change.

    XᵀC⁻¹X is WᵀW less Gᵀ diag(signs) G.

    Attributes:
        white: W, columns and readings by what is known of the latter whatever acts, (m, q + 1).
        gone: G, what acted at first and all changes since, (r, q + 1), and ``signs`` of them, (r,).
        known: rows of the families that were asked for, by where they begin.
    """

    white: Array
    gone: Array
    signs: Array
    known: dict[int, tuple[slice, Array]] = field(default_factory=dict)

    @property
    def toward(self) -> Array:
        """See :class:`Products`."""
        return np.asarray(self._between(slice(-1, None), slice(None))[0])

    def block(self, own: slice) -> Array:
        """See :class:`Products`."""
        return self._between(own, own)

    def rows(self, own: slice) -> Array:
        """See :class:`Products`."""
        if own.start not in self.known:
            self.known[own.start] = own, self._between(own, slice(None))
        return self.known[own.start][1]

    def take_out(self, waiting: Array, signs: Array) -> None:
        """See :class:`Products`."""
        self.gone, self.signs = np.concatenate([self.gone, waiting]), np.append(self.signs, signs)
        for own, rows in self.known.values():
            rows -= (waiting[:, own].T * signs) @ waiting

    def _between(self, own: slice, others: slice) -> Array:
        gone = (self.gone[:, own].T * self.signs) @ self.gone[:, others]
        return np.asarray(self.white[:, own].T @ self.white[:, others] - gone)


@dataclass
class ReadingPrecision:
    """What is known at one draw of the sizes, with C the covariance of the readings.

    XᵀC⁻¹X is ``products`` less Fᵀ diag(signs) F of the changes that wait.

    Attributes:
        products: of all families and, the last, of the readings, before the changes that wait.
        toward: XᵀC⁻¹y of the same, and behind them the 0 of a column that is nought, (q + 2,).
        places: of the columns of each family, (f,), and ``widths``, as they are padded, (f,).
        positions: of each family among those as wide, (f,) int.
        blocks: families by their padded width.
        waiting: F in its first rows, with a column that is nought behind them, (r, q + 2), and ``signs``, (r,).
    """

    products: Products
    toward: Array
    places: tuple[slice, ...]
    widths: tuple[int, ...]
    positions: np.ndarray
    blocks: dict[int, _SameWidth]
    waiting: Array
    signs: Array

    @classmethod
    def of(cls, products: Products, places: Sequence[slice]) -> Self:
        """Begin with XᵀC⁻¹X of the columns, the readings behind them, and places of families (f,)."""
        toward = np.append(products.toward, 0.0)
        widths = [padded_width(p.stop - p.start) for p in places]
        positions, blocks, none = np.zeros(len(widths), dtype=int), dict[int, _SameWidth](), len(toward) - 1
        for k in dict.fromkeys(widths):
            mine = [f for f, width in enumerate(widths) if width == k]
            positions[mine] = np.arange(len(mine))
            at, grams = np.full((len(mine), k), none), np.zeros((len(mine), k, k))
            for own, gram, place in zip(at, grams, (places[f] for f in mine), strict=True):
                own[: place.stop - place.start] = np.arange(place.start, place.stop)
                gram[: place.stop - place.start, : place.stop - place.start] = products.block(place)
            blocks[k] = _SameWidth(at, grams)
        room = np.zeros((MOST_WAITING + max(widths), len(toward)))
        return cls(products, toward, tuple(places), tuple(widths), positions, blocks, room, np.zeros(0))

    def grams(self, families: Sequence[int] | np.ndarray) -> Array:
        """Return XᵀC⁻¹X of families of one padded width k, (f, k, k)."""
        own = self.blocks[self.widths[families[0]]]
        own.take(self._waiting, self.signs)
        return np.asarray(own.grams[self.positions[families]])

    def block(self, family: int) -> FamilyBlock:
        """Return the products that are needed to change the size of a family."""
        place = self.places[family]
        own = self.grams([family])[0, : place.stop - place.start, : place.stop - place.start]
        values, axes = np.linalg.eigh(own)
        return FamilyBlock(family, axes, np.maximum(values, 0.0), axes.T @ self.toward[place])

    def gains(self, families: Sequence[int] | np.ndarray, more: Array) -> Array:
        """Return the growth (f, v) of the log density with ``more`` variances (v,) of families of one padded width.

        The Cholesky factor of [[1 + vG, √v t], [√v tᵀ, 1 + v tᵀt]] says all: its diagonal the determinant, and its last
        row √v t per root of 1 + vG.
        """
        own = self.blocks[k := self.widths[families[0]]]
        t = np.sqrt(more)[:, None] * self.toward[own.at[self.positions[families]]][:, None]
        wide = np.empty((len(families), len(more), k + 1, k + 1))
        np.multiply(more[:, None, None], self.grams(families)[:, None], out=wide[..., :k, :k])
        diagonal = np.einsum("fvii->fvi", wide)  # a view
        diagonal[..., :k] += 1
        wide[..., k, :k], diagonal[..., k] = t, 1 + np.einsum("fvk,fvk->fv", t, t)
        root = np.linalg.cholesky(wide)  # looks at the lower triangle only
        log_det = np.log(np.einsum("fvii->fvi", root)[..., :k]).sum(axis=2)
        return np.asarray(0.5 * (root[..., k, :k] ** 2).sum(axis=2) - log_det)

    def add(self, block: FamilyBlock, variance: float) -> None:
        """Add ``variance`` times the family's columns to C (Woodbury)."""
        sign, own, first = float(np.sign(variance)), self.places[block.family], len(self.signs)
        told = abs(variance) * block.values > 1e-5  # of what is known of a direction, below which its change is none
        grown = np.maximum(1 + variance * block.values[told], LEAST_LEFT_SHARE)
        axes = block.axes[:, told] * np.sqrt(abs(variance) / grown)
        sides = self.waiting[first : first + axes.shape[1]]
        turned = (self._waiting[:, own] @ axes).T * self.signs
        np.subtract(axes.T @ self.products.rows(own), turned @ self._waiting[:, :-1], out=sides[:, :-1])
        self.toward = self.toward - sign * (axes.T @ self.toward[own]) @ sides
        self.signs = np.append(self.signs, np.full(len(sides), sign))
        if len(self.signs) > MOST_WAITING:
            self._settle()

    @property
    def _waiting(self) -> Array:
        return self.waiting[: len(self.signs)]

    def _settle(self) -> None:
        """Put the changes that wait where they belong."""
        for same in self.blocks.values():
            same.take(self._waiting, self.signs)
            same.taken = 0
        self.products.take_out(self._waiting[:, :-1], self.signs)
        self.signs = self.signs[:0]


def _symmetric(lower: Array) -> Array:
    """Return the matrix (k, k) of a lower triangle, whatever stands above it."""
    return np.where(np.tri(len(lower), dtype=bool), lower, lower.T)
