"""What the readings tell of each family of columns, kept up to date while sizes of families change.

The covariance C of the readings is far smaller than what it says of all columns X, XᵀC⁻¹X: of that only the blocks of
the families are kept, and C⁻¹ itself, so that a change costs the readings times the columns and not their square.
Changes wait until there are many of them: whoever asks for a family is told of those that wait, and all of them in one
product of matrices takes a quarter of the time of one after the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

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


@dataclass(frozen=True)
class _SameWidth:
    """Families of k columns each: where these stand, (f, k) int, and of every family XᵀC⁻¹X, (f, k, k).

    Changes that wait are not in it yet.
    """

    rows: np.ndarray
    grams: Array


@dataclass
class ReadingPrecision:
    """What is known of the readings at one draw of the sizes, with C their covariance and C₀ that at the start.

    C₀^(1/2) C⁻¹ C₀^(1/2) is ``inner`` less F diag(signs) Fᵀ of the changes that wait.

    Attributes:
        rows: C₀^(−1/2) X of all families, its transpose, (q, m).
        inner: C₀^(1/2) C⁻¹ C₀^(1/2) before the changes that wait, (m, m).
        white: C₀^(−1/2) y, (m,), and ``toward`` C₀^(1/2) C⁻¹ y, (m,).
        widths: of every family, (f,), and ``positions`` among those as wide, (f,).
        blocks: families by their width.
        waiting: F, (m, r), and ``signs``, (r,).
    """

    rows: Array
    inner: Array
    white: Array
    toward: Array
    widths: tuple[int, ...]
    positions: tuple[int, ...]
    blocks: dict[int, _SameWidth]
    waiting: Array
    signs: Array

    @classmethod
    def of(cls, columns: Array, y: Array, places: Sequence[slice]) -> Self:
        """Begin with white columns (m, q) and readings (m,), the columns of each family in its place, (f,)."""
        widths = tuple(p.stop - p.start for p in places)
        positions, blocks = np.zeros(len(widths), dtype=int), dict[int, _SameWidth]()
        rows = np.ascontiguousarray(columns.T)
        for k in dict.fromkeys(widths):
            mine = [f for f, width in enumerate(widths) if width == k]
            positions[mine] = np.arange(len(mine))
            at = np.array([places[f].start for f in mine])[:, None] + np.arange(k)
            own = rows[at]
            blocks[k] = _SameWidth(at, own @ own.transpose(0, 2, 1))
        m, where = len(y), tuple(positions.tolist())
        return cls(rows, np.eye(m), y, y.copy(), widths, where, blocks, np.zeros((m, 0)), np.zeros(0))

    def grams(self, families: Sequence[int]) -> Array:
        """Return XᵀC⁻¹X of families of k columns each, (f, k, k)."""
        own, at = self.blocks[self.widths[families[0]]], [self.positions[f] for f in families]
        moved = self._rows_of(families) @ self.waiting
        return np.asarray(own.grams[at] - moved * self.signs @ moved.transpose(0, 2, 1))

    def block(self, family: int) -> FamilyBlock:
        """Return the products that are needed to change the size of a family."""
        values, axes = np.linalg.eigh(self.grams([family])[0])
        toward = axes.T @ (self._rows_of([family])[0] @ self.toward)
        return FamilyBlock(family, axes, np.maximum(values, 0.0), toward)

    def gains(self, families: Sequence[int], more: Array) -> Array:
        """Return the growth (f, v) of the log density with ``more`` variances (v,) of families of k columns each.

        The Cholesky factor of [[1 + vG, √v t], [√v tᵀ, 1 + v tᵀt]] says all: its diagonal the determinant, and its last
        row √v t per root of 1 + vG.
        """
        k = self.widths[families[0]]
        t = np.sqrt(more)[:, None] * (self._rows_of(families) @ self.toward)[:, None]
        wide = np.empty((len(families), len(more), k + 1, k + 1))
        wide[..., :k, :k] = more[:, None, None] * self.grams(families)[:, None] + np.eye(k)
        wide[..., k, :k], wide[..., k, k] = t, 1 + (t**2).sum(axis=2)
        root = np.linalg.cholesky(wide)  # looks at the lower triangle only
        log_det = np.log(np.einsum("fvii->fvi", root)[..., :k]).sum(axis=2)
        return np.asarray(0.5 * (root[..., k, :k] ** 2).sum(axis=2) - log_det)

    def add(self, block: FamilyBlock, variance: float) -> None:
        """Add ``variance`` times the family's columns to C (Woodbury)."""
        sign = float(np.sign(variance))
        axes = block.axes * np.sqrt(abs(variance) / np.maximum(1 + variance * block.values, LEAST_LEFT_SHARE))
        added = self._rows_of([block.family])[0].T @ axes
        side = self.inner @ added - self.waiting * self.signs @ (self.waiting.T @ added)
        self.toward = self.toward - sign * side @ (side.T @ self.white)
        self.waiting = np.hstack([self.waiting, side])
        self.signs = np.append(self.signs, np.full(side.shape[1], sign))
        if len(self.signs) > MOST_WAITING:
            self._settle()

    def _settle(self) -> None:
        """Put the changes that wait where they belong."""
        moved = self.rows @ self.waiting
        for own in self.blocks.values():
            each = moved[own.rows]
            own.grams[:] -= each * self.signs @ each.transpose(0, 2, 1)
        self.inner = self.inner - self.waiting * self.signs @ self.waiting.T
        self.waiting, self.signs = self.waiting[:, :0], self.signs[:0]

    def _rows_of(self, families: Sequence[int]) -> Array:
        """Return the white columns of families of k columns each, transposed, (f, k, m)."""
        own = self.blocks[self.widths[families[0]]]
        return np.asarray(self.rows[own.rows[[self.positions[f] for f in families]]])
