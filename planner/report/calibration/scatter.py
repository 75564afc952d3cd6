"""Pictures of what the error still follows: joints, loads, the gauge's reading, circumstances, sense of approach."""

import numpy as np

from planner.repeatable import evenly
from planner.report.calibration.data import POINTS, Against, Told, error_along
from planner.report.picture import BLACK, BLUE, GREEN, GREY, RED, Limit, Panel, Picture, Series
from planner.units import Array, to_mm

MEANS = 16  # points of the line through the residuals
KINDS = {
    "joints": ("residual_joints", "Error against each joint"),
    "loads": ("residual_loads", "Error against the load on each joint"),
    "gauge": ("residual_gauge", "Error against where the gauge reads"),
    "circumstances": ("residual_circumstances", "Error against time and circumstances"),
}
SCATTER = (
    "What the calibrated robot leaves, on samples that the fit had not seen. The line is the mean: where it leaves "
    "zero, the model does not say all."
)


def residuals(told: Told, kind: str) -> Picture:
    """Residuals of the last stage against every quantity of one kind."""
    name, title = KINDS[kind]
    error = to_mm(told.after.held_residual[told.looked][:, :3])
    panels = tuple(_scatter(a, error) for a in told.against if a.kind == kind)
    return Picture(name, title, SCATTER, panels, columns=2)


def approach(told: Told) -> Picture:
    """Residuals of every joint's two senses of approach, side by side."""
    samples = told.calibration.run.samples
    assert samples.direction is not None
    which = told.looked[evenly(len(told.looked), POINTS // 3)]
    sense = samples.direction[told.looked]
    joints = np.arange(1, sense.shape[1] + 1)
    across = 0.14 * (np.arange(len(which)) * 0.6180339887 % 1 - 0.5)  # golden steps: points side by side, not on one
    panels = []
    for stage, side in ((told.before, "gauge placed"), (told.after, "calibrated")):
        error = to_mm(error_along(stage.held_residual))
        few, x = error[which], joints + 0.2 * samples.direction[which] + across[:, None]
        cloud = Series("one reading", x.ravel(), np.repeat(few, len(joints)), BLUE, "points", size=3.0, opacity=0.35)
        seen = [(j, s, sense[:, j - 1] == s) for j in joints for s in (-1.0, 1.0) if (sense[:, j - 1] == s).any()]
        at = np.array([j + 0.2 * s for j, s, _ in seen])
        mean = np.array([error[told.looked][here].mean() for _, _, here in seen])
        means = Series("mean", at, mean, BLACK, "points", size=8.0)
        span = 1.08 * float(np.abs(few).max()) or 1.0
        label = "joint: left came from above, right from below"
        panels.append(Panel(side, label, "error (mm)", (cloud, means), (Limit(0.0, ""),), y_range=(-span, span)))
    caption = (
        "Two means of a joint that differ tell of backlash or friction. Where positions are read, the error is the "
        "part along the direction in which it varies most."
    )
    return Picture("residual_approach", "Error against the sense of the last approach", caption, tuple(panels), 2)


def _scatter(a: Against, error: Array) -> Panel:
    """One panel: points, and for each component the line of means."""
    wide = error.shape[1] > 1
    colours = (BLUE, GREEN, RED) if wide else (BLUE,)
    series, shown = [], evenly(len(error), POINTS)
    for k, colour in enumerate(colours):
        name = f"along {'xyz'[k]}" if wide else "a reading"
        series.append(Series(name, a.values[shown], error[shown, k], colour, "points", size=3.5, opacity=0.4))
    for k, colour in enumerate(colours):
        at, mean = _means(a.values, error[:, k])
        series.append(Series("mean", at, mean, colour if wide else BLACK, width=2.0))
    span = 1.08 * float(np.abs(error[shown]).max()) or 1.0
    series.append(Series("", np.array([a.values.min(), a.values.max()]), np.zeros(2), GREY, dashed=True, width=1.0))
    return Panel("", a.label, "error (mm)", tuple(series), y_range=(-span, span), height=150)


def _means(x: Array, y: Array) -> tuple[Array, Array]:
    """Means of y in groups of equal count along x; a quantity with few values has one group a value."""
    values, group = np.unique(x, return_inverse=True)
    if len(values) > MEANS:
        group = np.empty(len(x), dtype=int)
        group[np.argsort(x, kind="stable")] = np.arange(len(x)) * MEANS // len(x)
    count = np.bincount(group)
    kept = count > 0
    return np.bincount(group, x)[kept] / count[kept], np.bincount(group, y)[kept] / count[kept]
