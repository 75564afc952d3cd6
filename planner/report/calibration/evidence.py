"""Pictures of the loop: the error stage by stage, and each effect before and after it was added."""

import numpy as np

from planner.repeatable import evenly
from planner.report.calibration.data import POINTS, Told
from planner.report.calibration.story import MEANS, Evidence, Step, evidence
from planner.report.picture import BLACK, BLUE, GREY, ORANGE, RED, Panel, Picture, Series
from planner.units import Array, to_mm

NAMES = {"nominal": "data sheet", "frames": "gauge placed", "geometry": "geometry fitted"}
SEEN = 0.98  # part of the points that the panel's height is made for
SIZES = {"rad": "µrad", "m": "µm"}


def by_stage(told: Told) -> Picture:
    """Error of every stage, fitted and held out."""
    stages = told.calibration.stages
    names = tuple(NAMES.get(s.name, s.name) for s in stages)
    places = np.arange(len(stages), dtype=float)
    held, train = (
        to_mm(np.array([m.rms for m in side])) for side in zip(*((s.held_out, s.train) for s in stages), strict=True)
    )
    series = [
        Series("", np.array([low, high]), np.array([k, k]), ORANGE, width=5.0, opacity=0.4)
        for k, (low, high) in enumerate(zip(*_span(told, held), strict=True))
        if high > low
    ]
    series += [
        Series("fitted samples", train, places, GREY, "points", size=7.0),
        Series("held out, with the spread over the parts", held, places, ORANGE, "points", size=9.0),
    ]
    checked = [(k, s.validation.rms) for k, s in enumerate(stages) if s.validation is not None]
    if checked:
        at, rms = np.array(checked).T
        series.append(Series("validation run", to_mm(rms), at, BLUE, "points", size=7.0))
    panel = Panel(
        "", "rms error (mm, logarithmic)", "", tuple(series), log_x=True, y_names=names, height=_height(names)
    )
    caption = "From top to bottom the model grows by one effect at a time; what counts is the held-out error."
    return Picture("by_stage", "The error stage by stage", caption, (panel,))


def _span(told: Told, held: Array) -> tuple[Array, Array]:
    spread_mm = to_mm(np.array([s.held_out.spread or 0.0 for s in told.calibration.stages]))
    return np.maximum(held - spread_mm, 0.3 * held), held + spread_mm


def _height(names: tuple[str, ...]) -> int:
    return max(150, 26 * len(names) + 40)


def found(told: Told, step: Step) -> Picture:
    """One effect: what the residual says of it before (left) and after (right) it was added."""
    e = evidence(told, step)
    span = 1e6 * max(
        float(np.quantile(np.abs(e.before), SEEN)), 1.15 * float(np.quantile(np.abs(e.fitted), SEEN)), 1e-12
    )
    panels = tuple(
        _panel(e, values, side, fitted, span)
        for values, side, fitted in ((e.before, "before", True), (e.after, "after", False))
    )
    caption = (
        "Held-out residuals, each as the error of the effect's own axis. Points: readings; black: their mean"
        if e.unit == "rad"
        else "Held-out residuals along what the effect moves. Points: readings; black: their mean"
    )
    return Picture(
        step.name,
        step.finding.note,
        f"{caption}; red: the effect as fitted in the end, less what the model before it could take up.",
        panels,
        columns=2,
    )


def _panel(e: Evidence, values: Array, title: str, fitted: bool, span: float) -> Panel:
    x, y = e.against.folded, 1e6 * values
    heavy = np.flatnonzero(e.weight >= 0.09 * np.median(e.weight))
    shown = heavy[evenly(len(heavy), POINTS)]
    inside = shown[np.abs(y[shown]) <= span]
    zero = Series("", np.array([x.min(), x.max()]), np.zeros(2), GREY, dashed=True, width=1.0)
    series = [zero, Series("", _apart(x)[inside], y[inside], BLUE, "points", size=3.5, opacity=0.35)]
    if fitted:
        series.append(Series("as fitted", *weighted_means(x, 1e6 * e.fitted, e.weight, e.means), RED, width=3.0))
    at, mean = weighted_means(x, y, e.weight, e.means)
    series.append(Series("mean", at, mean, BLACK, width=1.8))
    return Panel(f"{title} ({SIZES[e.unit]})", e.against.label, "", tuple(series), y_range=(-span, span), height=210)


def _apart(x: Array) -> Array:
    """Move points of a quantity with few values side by side, by golden steps: they do not lie on each other then."""
    values = np.unique(x)
    if len(values) > 8 or len(values) < 2:
        return x
    return np.asarray(x + 0.3 * float(np.diff(values).min()) * (np.arange(len(x)) * 0.6180339887 % 1 - 0.5))


def weighted_means(x: Array, y: Array, weight: Array, most: int = MEANS) -> tuple[Array, Array]:
    """Means of y in groups of equal count along x, by weight; a quantity with few values has one group a value."""
    values, group = np.unique(x, return_inverse=True)
    if len(values) > most:
        group = np.empty(len(x), dtype=int)
        group[np.argsort(x, kind="stable")] = np.arange(len(x)) * most // len(x)
    total = np.bincount(group, weight)
    kept = total > 0
    middle = np.bincount(group, x) / np.maximum(np.bincount(group), 1)
    return middle[kept], np.bincount(group, weight * y)[kept] / total[kept]
