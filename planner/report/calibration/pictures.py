"""Pictures of a calibration: errors before and after, what they still follow, what hangs together."""

import numpy as np

from planner.identification import error_size
from planner.report.calibration.data import Told, error_by_pose
from planner.report.calibration.evidence import by_stage, found
from planner.report.calibration.scatter import KINDS, approach, residuals
from planner.report.calibration.story import steps
from planner.report.picture import BLUE, ORANGE, Cells, Panel, Picture, Series
from planner.report.words import sized
from planner.units import Array, to_mm

BEFORE, AFTER = ORANGE, BLUE
BINS = 60  # of the histogram
MOST = 60  # parameters in the correlation matrix
ROW = 20  # [px] of one name in the correlation matrix


def pictures(told: Told) -> tuple[Picture, ...]:
    """Return every picture of the report."""
    drawn = [residuals(told, kind) for kind in KINDS if any(a.kind == kind for a in told.against)]
    if told.calibration.run.samples.direction is not None:
        drawn.append(approach(told))
    matrix = (correlation(told),) if len(told.calibration.fit.errors) > 1 else ()
    loop = (by_stage(told), *(found(told, step) for step in steps(told)))
    return (histogram(told), by_pose(told), *loop, *drawn, *matrix)


def histogram(told: Told) -> Picture:
    """How many samples have which error, before and after."""
    before, after = (to_mm(error_size(s.held_residual)) for s in (told.before, told.after))
    low = max(float(np.quantile(after, 0.005)), float(before.max()) * 1e-6, 1e-7)
    high = 1.1 * max(float(before.max()), float(after.max()))
    edges = np.geomspace(min(low, high / 10), high, BINS + 1)
    series = [
        Series(f"{name}, mean {sized(float(e.mean()))} mm", *_steps(e, edges), colour, filled=True)
        for name, e, colour in (("gauge placed", before, BEFORE), ("calibrated", after, AFTER))
    ]
    top = 1.1 * max(float(s.y.max()) for s in series)
    panel = Panel(
        "",
        "error of a reading that the fit had not seen (mm, logarithmic)",
        "part of the readings (%)",
        tuple(series),
        log_x=True,
        x_range=(float(edges[0]), float(edges[-1])),
        y_range=(0.0, top),
        height=230,
    )
    caption = "Every reading was predicted by a fit that had not seen it. One step of the scale is ten times less."
    return Picture("histogram", "Error before and after", caption, (panel,))


def _steps(error: Array, edges: Array) -> tuple[Array, Array]:
    """Outline of a histogram in per cent; what lies below the scale counts at its end."""
    share = 100 * np.histogram(np.clip(error, edges[0], edges[-1]), edges)[0] / len(error)
    return np.repeat(edges, 2), np.concatenate([[0.0], np.repeat(share, 2), [0.0]])


def by_pose(told: Told) -> Picture:
    """Error of every pose, before and after, in the order in which they were measured."""
    names, before, after = error_by_pose(told)
    floor = max(float(np.quantile(after, 0.02)) / 2, 1e-10)
    x = np.arange(1, len(names) + 1, dtype=float)
    series = [
        Series(
            label,
            x,
            to_mm(np.maximum(values, floor)),
            colour,
            "points",
            hover=tuple(f"{n}: {sized(float(v))} mm" for n, v in zip(names, to_mm(values), strict=True)),
            size=5.0,
            opacity=0.8,
        )
        for label, values, colour in (("gauge placed", before, BEFORE), ("calibrated", after, AFTER))
    ]
    moving = told.calibration.run.continuous or told.calibration.run.samples.pose is None
    what = "sample drawn" if moving else "pose"
    high = 1.5 * float(to_mm(max(before.max(), after.max())))
    panel = Panel(
        "",
        f"{what}, in the order of measuring",
        "error (mm, logarithmic)",
        tuple(series),
        log_y=True,
        y_range=(float(to_mm(floor)) / 1.3, high),
        height=270,
    )
    caption = f"Each {what} as predicted by a fit that had not seen it. Point at one for its number."
    return Picture("by_pose", f"Error of each {what}", caption, (panel,))


def correlation(told: Told) -> Picture:
    """Correlations of the fitted parameters; of many, those that hang together most."""
    matrix = told.correlation
    strongest = np.abs(matrix - np.eye(len(matrix))).max(axis=1)
    kept = np.sort(np.argsort(-strongest, kind="stable")[:MOST])
    names = tuple(told.calibration.fit.model.names[k] for k in kept)
    cells = Cells(matrix[np.ix_(kept, kept)], names)
    panel = Panel("", "", "", (), y_names=names, cells=cells, height=max(240, ROW * len(names)))
    caption = (f"The {MOST} of {len(matrix)} that hang together most. " if len(matrix) > MOST else "") + (
        "Blue: two parameters err together; orange: in opposite senses. A strong colour means that the run knows "
        "the two better together than each by itself."
    )
    return Picture("correlation", "Which parameters hang together", caption, (panel,))
