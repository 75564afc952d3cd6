"""What the readings say of each family of columns, kept up to date while sizes of families change."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.common.units import Array
from planner.model.linear_gaussian import LEAST_LEFT_SHARE, LinearGaussian


def padded_width(columns: int) -> int:
    """Return 2ᵏ, or 3·2ᵏ of many, not below a number of columns: families of about as many are looked at together."""
    power = 1 << (columns - 1).bit_length()
    return max(2, power) if columns <= 16 or 4 * columns > 3 * power else 3 * power // 4


@dataclass
class _SameWidth:
    """Families of up to k columns: where these stand, (f, k) int, and XᵀC⁻¹X of each, (f, k, k); zeros fill up."""

    at: np.ndarray
    grams: Array


class FamilyGains:
    """The evidence that each family would add or lose with another size, whatever acts now.

    ``model`` has the columns of all families, one family after the other, and the readings behind them as one column
    more that is absent; ``places`` (f,) say which columns are whose. All products are with C⁻¹, the inverse covariance
    of the readings: a size that changes takes a few directions out of them.
    """

    def __init__(self, model: LinearGaussian, places: Sequence[slice]):
        self.model, self.places = model, tuple(places)
        self.widths = tuple(padded_width(p.stop - p.start) for p in places)
        # columns as rows; zeros are the last, to which what fills up points
        self.rows = np.zeros((model.white.shape[1] + 1, len(model.white)))
        self.rows[:-1] = model.white.T
        whole, shown = model.through(self.rows)
        self.toward = whole @ whole[-2] - shown @ shown[-2]
        self.positions = np.zeros(len(places), dtype=int)
        self.blocks = dict[int, _SameWidth]()
        for k in dict.fromkeys(self.widths):
            mine = [f for f, width in enumerate(self.widths) if width == k]
            self.positions[mine] = np.arange(len(mine))
            at = np.full((len(mine), k), len(self.rows) - 1)
            for own, place in zip(at, (places[f] for f in mine), strict=True):
                own[: place.stop - place.start] = np.arange(place.start, place.stop)
            grams = whole[at] @ whole[at].transpose(0, 2, 1) - shown[at] @ shown[at].transpose(0, 2, 1)
            self.blocks[k] = _SameWidth(at, grams)

    def grams(self, families: Sequence[int] | np.ndarray) -> Array:
        """Return XᵀC⁻¹X of families of one padded width k, (f, k, k)."""
        return self.blocks[self.widths[families[0]]].grams[self.positions[families]]

    def change_gains(self, family: int, more: Array) -> Array:
        """Return the growth (v,) of the log evidence with ``more`` variances (v,), which may be negative, of a family.

        In the axes in which XᵀC⁻¹X of its columns is diagonal.
        """
        place = self.places[family]
        width = place.stop - place.start
        values, axes = np.linalg.eigh(self.grams([family])[0, :width, :width])
        toward, values = axes.T @ self.toward[place], np.maximum(values, 0.0)
        grown = np.maximum(1 + more[:, None] * values, LEAST_LEFT_SHARE)
        return np.asarray(0.5 * (more[:, None] * toward**2 / grown - np.log(grown)).sum(axis=1))

    def gains(self, families: Sequence[int] | np.ndarray, more: Array) -> Array:
        """Return the growth (f, v) of the log evidence with ``more`` variances (v,) of families of one padded width.

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

    def set_size(self, family: int, factor: float) -> None:
        """Give a family another size."""
        place = self.places[family]
        change = self.model.change(place, factor, 1e-5)  # a share of the noise's variance that decides nothing
        self.model = self.model.with_change(change, place, factor)
        moved = self.rows @ change.sides
        self.toward = self.toward - moved @ (moved[-2] * change.signs)
        for same in self.blocks.values():
            each = moved[same.at]
            same.grams -= (each * change.signs) @ each.transpose(0, 2, 1)
