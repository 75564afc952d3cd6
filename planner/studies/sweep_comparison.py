"""Which points of a sweep differ beyond chance: the same arms at each, so that differences are of pairs."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from math import erfc
from typing import Any

import numpy as np
import polars as pl

from planner.common.units import Array

RANK = "rank"


@dataclass(frozen=True)
class SweepComparison:
    """Figures of every point, best first, and pairs of neighbours; see :class:`planner.studies.sweep.SweepResult`."""

    figures: pl.DataFrame
    pairs: pl.DataFrame


def compare_neighbours(table: pl.DataFrame, axes: tuple[str, ...]) -> SweepComparison:
    """Return medians over the arms with standard errors, and differences of neighbours with theirs.

    Neighbours are points that follow each other in rank, and points that differ in one axis by one step. Standard
    errors are of resampled arms (bootstrap), the same arms for both points of a pair.

    Args:
        table: one row a trial, with ``point``, the axes and the errors.
        axes: the columns that tell points apart, ``cell`` and ``poses`` among them.
    """
    points = _rank_points(table, axes)
    errors = {k: part["posterior_mm"].to_numpy() for (k,), part in table.group_by("point", maintain_order=True)}
    medians = _Medians({k: e for k, e in errors.items() if np.isfinite(e).all()})
    ranked = [k for k in points["point"] if k in medians.arms]
    places = [(RANK, a, b) for a, b in pairwise(ranked)]
    places += [(axis, a, b) for axis, a, b in _steps(points.sort("point"), axes) if {a, b} <= medians.arms.keys()]
    rows = [_compare(medians, *place) for place in places]
    for row, differs in zip(rows, _find_differences([r["p"] for r in rows]), strict=True):
        row["differs"] = differs
    told = {str(k): v for k, v in zip(points["point"], points.select(axes).iter_rows(named=True), strict=True)}
    pairs = pl.DataFrame([_with_names(row, told) for row in rows], schema=PAIR_COLUMNS, orient="row")
    following = {r["point"]: r for r in rows if r["along"] == RANK}
    se = [medians.standard_error(k) for k in points["point"]]
    beside = [following.get(k, {}) for k in points["point"]]
    figures = points.with_columns(
        pl.Series("posterior_se_mm", se, pl.Float64),
        pl.Series("next_difference_mm", [r.get("difference_mm") for r in beside], pl.Float64),
        pl.Series("next_difference_se_mm", [r.get("se_mm") for r in beside], pl.Float64),
        pl.Series("next_differs", [r.get("differs") for r in beside], pl.Boolean),
    )
    return SweepComparison(figures, pairs)


PAIR_COLUMNS = {
    "along": pl.String, "point": pl.Int64, "neighbour": pl.Int64, "of": pl.String, "and": pl.String,
    "difference_mm": pl.Float64, "se_mm": pl.Float64, "p": pl.Float64, "differs": pl.Boolean,
}  # fmt: skip


def _rank_points(table: pl.DataFrame, axes: tuple[str, ...]) -> pl.DataFrame:
    value = pl.col("posterior_mm")
    figures = [
        pl.col("nominal_mm").median(), pl.col("geometry_mm").median(), value.median(),
        value.quantile(0.95).alias("posterior_95_mm"), pl.len().alias("arms"), pl.col("because").first(),
    ]  # fmt: skip
    grouped = table.group_by("point", *axes, maintain_order=True).agg(figures)
    return grouped.with_columns(pl.col(pl.Float64).fill_nan(None)).sort(
        "posterior_mm", nulls_last=True, maintain_order=True
    )


def _steps(points: pl.DataFrame, axes: tuple[str, ...]) -> list[tuple[str, int, int]]:
    """Return the pairs of points that differ in one axis alone, by one step in the order of the file."""
    out = []
    for axis in axes:
        others = [a for a in axes if a != axis]
        groups: Iterable[tuple[Any, pl.DataFrame]] = points.group_by(others, maintain_order=True)
        out += [(axis, a, b) for _, part in groups for a, b in pairwise(part["point"].to_list())]
    return out


class _Medians:
    """Medians of the arms' errors, and of resampled arms."""

    def __init__(self, arms: dict[int, Array]) -> None:
        self.arms = arms
        fewest = min((len(e) for e in arms.values()), default=0)
        # 400: resamples: the standard error of a median is then known to 4 %
        self._drawn = np.random.default_rng(0).integers(0, max(fewest, 1), (400, fewest))
        self._resampled: dict[int, Array] = {}
        self.known = fewest >= 10  # arms: of fewer a standard error of a median means nothing

    def resample(self, point: int) -> Array:
        """Return the median of each resample of a point's arms, (k,) [mm]."""
        if point not in self._resampled:
            self._resampled[point] = np.median(self.arms[point][self._drawn], axis=1)
        return self._resampled[point]

    def standard_error(self, point: int) -> float | None:
        """Return the standard error of a point's median [mm]; ``None`` where it is not known."""
        return float(self.resample(point).std(ddof=1)) if self.known and point in self.arms else None


def _compare(medians: _Medians, along: str, a: int, b: int) -> dict[str, Any]:
    """Return the difference of two points' medians, b − a, with its standard error and probability by chance."""
    difference = float(np.median(medians.arms[b]) - np.median(medians.arms[a]))
    row: dict[str, Any] = {"along": along, "point": a, "neighbour": b, "difference_mm": difference}
    if not medians.known:
        return row | {"se_mm": None, "p": None}
    se = float((medians.resample(b) - medians.resample(a)).std(ddof=1))
    p = 1.0 if difference == 0.0 else erfc(abs(difference) / (np.sqrt(2) * se)) if se > 0 else 0.0
    return row | {"se_mm": se, "p": float(p)}


def _find_differences(p: list[float | None]) -> list[bool | None]:
    """Tell which differences are not chance, by the method of Holm (1979) over all pairs with a probability."""
    level = 0.05  # [1] probability that any pair without a difference is called one
    known = [k for k, v in enumerate(p) if v is not None]
    out: list[bool | None] = [None] * len(p)
    rejected = True
    for rank, k in enumerate(sorted(known, key=lambda k: p[k] or 0.0)):
        rejected = rejected and (p[k] or 0.0) <= level / (len(known) - rank)
        out[k] = rejected
    return out


def _with_names(row: dict[str, Any], told: dict[str, dict[str, Any]]) -> dict[str, Any]:
    a, b = told[str(row["point"])], told[str(row["neighbour"])]
    apart = [k for k in a if a[k] != b[k]]
    texts = (", ".join(f"{k} {values[k]}" for k in apart) for values in (a, b))
    return row | dict(zip(("of", "and"), texts, strict=True))
