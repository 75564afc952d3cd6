"""What the readings tell of each family of columns, kept up to date while sizes of families change.

The covariance C of the readings is far smaller than what it says of all columns X, XᵀC⁻¹X: of that only the blocks of
the families are kept, and C⁻¹ itself, so that a change costs the readings times the columns and not their square.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from planner.common.units import Array

LEAST_LEFT_SHARE = 1e-12  # of a direction's variance that the readings leave


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
    """Families of k columns each: where these stand, (f, k) int, and XᵀC⁻¹X of every family, (f, k, k)."""

    rows: np.ndarray
    grams: Array


@dataclass
class ReadingPrecision:
    """What is known of the readings at one draw of the sizes, with C their covariance and C₀ that at the start.

    Attributes:
        columns: C₀^(−1/2) X of all families, (m, q).
        inner: C₀^(1/2) C⁻¹ C₀^(1/2), (m, m).
        toward: XᵀC⁻¹y, (q,).
        widths: of every family, (f,), and ``positions`` among those as wide, (f,).
        blocks: families by their width.
    """

    columns: Array
    inner: Array
    toward: Array
    widths: tuple[int, ...]
    positions: tuple[int, ...]
    blocks: dict[int, _SameWidth]

    @classmethod
    def of(cls, columns: Array, y: Array, places: Sequence[slice]) -> Self:
        """Begin with white columns (m, q) and readings (m,), the columns of each family in its place, (f,)."""
        widths = tuple(p.stop - p.start for p in places)
        positions, blocks = np.zeros(len(widths), dtype=int), dict[int, _SameWidth]()
        for k in dict.fromkeys(widths):
            mine = [f for f, width in enumerate(widths) if width == k]
            positions[mine] = np.arange(len(mine))
            rows = np.array([places[f].start for f in mine])[:, None] + np.arange(k)
            own = np.moveaxis(columns[:, rows], 0, 1)
            blocks[k] = _SameWidth(rows, own.transpose(0, 2, 1) @ own)
        return cls(columns, np.eye(len(y)), columns.T @ y, widths, tuple(positions.tolist()), blocks)

    def gram(self, family: int) -> Array:
        """Return XᵀC⁻¹X of one family, (k, k)."""
        return np.asarray(self.blocks[self.widths[family]].grams[self.positions[family]])

    def block(self, family: int) -> FamilyBlock:
        """Return what it takes to change the size of a family."""
        values, axes = np.linalg.eigh(self.gram(family))
        return FamilyBlock(family, axes, np.maximum(values, 0.0), axes.T @ self.toward[self._rows(family)])

    def gains(self, families: Sequence[int], more: Array) -> Array:
        """Return the growth (f, v) of the log density with ``more`` variances (v,) of families of k columns each.

        The Cholesky factor of [[1 + vG, √v t], [√v tᵀ, 1 + v tᵀt]] says all: its diagonal the determinant, and its last
        row √v t per root of 1 + vG.
        """
        k = self.widths[families[0]]
        own, at = self.blocks[k], [self.positions[f] for f in families]
        t = np.sqrt(more)[:, None] * self.toward[own.rows[at]][:, None]
        wide = np.empty((len(families), len(more), k + 1, k + 1))
        wide[..., :k, :k] = more[:, None, None] * own.grams[at][:, None] + np.eye(k)
        wide[..., k, :k], wide[..., k, k] = t, 1 + (t**2).sum(axis=2)
        root = np.linalg.cholesky(wide)  # looks at the lower triangle only
        log_det = np.log(np.einsum("fvii->fvi", root)[..., :k]).sum(axis=2)
        return np.asarray(0.5 * (root[..., k, :k] ** 2).sum(axis=2) - log_det)

    def add(self, block: FamilyBlock, variance: float) -> None:
        """Add ``variance`` times the family's columns to C (Woodbury)."""
        rows, sign = self._rows(block.family), float(np.sign(variance))
        axes = block.axes * np.sqrt(abs(variance) / np.maximum(1 + variance * block.values, LEAST_LEFT_SHARE))
        side = self.inner @ (self.columns[:, rows] @ axes)
        turned = self.columns.T @ side
        self.inner = self.inner - sign * side @ side.T
        self.toward = self.toward - sign * turned @ (axes.T @ self.toward[rows])
        for own in self.blocks.values():
            each = turned[own.rows]
            own.grams[:] -= sign * each @ each.transpose(0, 2, 1)

    def _rows(self, family: int) -> np.ndarray:
        return np.asarray(self.blocks[self.widths[family]].rows[self.positions[family]])
