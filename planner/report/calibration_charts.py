"""Charts of a calibration: errors before and after, residuals against every quantity, correlations."""

from typing import NamedTuple

import numpy as np

from planner.common.determinism import even_positions
from planner.common.units import Array, to_deg, to_mm
from planner.model.identification_document import error_size
from planner.model.tool_error import tool_position
from planner.model.use_text import TOOLS
from planner.release.error_parts import error_parts, misfit_motion, misfit_place, open_misfit
from planner.release.released_robot import ReleasedRobot
from planner.release.suitability import ENOUGH, target_errors
from planner.report.calibration_data import PANEL_POINTS, CalibrationFacts, PlotVariable, error_along, error_by_pose
from planner.report.chart import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    RED,
    Chart,
    ColourField,
    Heatmap,
    Panel,
    ReferenceLine,
    Series,
    golden_steps,
    histogram_outline,
    weighted_means,
    zero_line,
)
from planner.report.effect_evidence import finding_chart, stage_chart, told_findings
from planner.report.formatting import digits
from planner.report.history_charts import history_charts

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


def residual_chart(facts: CalibrationFacts, kind: str) -> Chart:
    """Residuals of the last stage against every quantity of one kind."""
    name, title = KINDS[kind]
    error = to_mm(facts.written_stage.held_residual[facts.chart_samples][:, :3])
    panels = tuple(_scatter(a, error, facts.calibration.reading_unit) for a in facts.plot_variables if a.kind == kind)
    return Chart(name, title, SCATTER, panels, columns=2)


def approach_chart(facts: CalibrationFacts) -> Chart:
    """Residuals of every joint's two senses of approach, side by side."""
    direction, unit = facts.calibration.run.samples.direction, facts.calibration.reading_unit
    assert direction is not None
    which = facts.chart_samples[even_positions(len(facts.chart_samples), PANEL_POINTS // 3)]
    sense = direction[facts.chart_samples]
    joints = np.arange(1, sense.shape[1] + 1)
    across = 0.14 * golden_steps(len(which))
    panels = []
    for stage in (facts.placed_stage, facts.written_stage):
        error = to_mm(error_along(stage.held_residual))
        few, x = error[which], joints + 0.2 * direction[which] + across[:, None]
        cloud = Series("one reading", x.ravel(), np.repeat(few, len(joints)), BLUE, "points", size=3.0, opacity=0.35)
        seen = [(j, s, sense[:, j - 1] == s) for j in joints for s in (-1.0, 1.0) if (sense[:, j - 1] == s).any()]
        at = np.array([j + 0.2 * s for j, s, _ in seen])
        mean = np.array([error[facts.chart_samples][here].mean() for _, _, here in seen])
        means = Series("mean", at, mean, BLACK, "points", size=8.0)
        span = 1.08 * float(np.abs(few).max()) or 1.0
        label = "joint: left came from above, right from below"
        panels.append(
            Panel(
                stage.name, label, f"error ({unit})", (cloud, means), (ReferenceLine(0.0, ""),), y_range=(-span, span)
            )
        )
    caption = (
        "Two means of a joint that differ tell of backlash or friction. Where positions are read, the error is the "
        "part along the direction in which it varies most."
    )
    return Chart("residual_approach", "Error against the sense of the last approach", caption, tuple(panels), 2)


def _scatter(a: PlotVariable, error: Array, unit: str) -> Panel:
    """One panel: points, and for each component the line of means."""
    wide = error.shape[1] > 1
    names, colours = (("along x", "along y", "along z"), (BLUE, GREEN, RED)) if wide else (("a reading",), (BLUE,))
    points, means, shown = [], [], even_positions(len(error), PANEL_POINTS)
    for name, colour, along in zip(names, colours, error.T, strict=True):
        points.append(Series(name, a.values[shown], along[shown], colour, "points", size=3.5, opacity=0.4))
        line = weighted_means(a.values, along, most=16)  # points of the line through the residuals
        means.append(Series("mean", *line, colour if wide else BLACK, width=2.0))
    span = 1.08 * float(np.abs(error[shown]).max()) or 1.0
    series = (*points, *means, zero_line(a.values))
    return Panel("", a.label, f"error ({unit})", series, y_range=(-span, span), height=150)


BEFORE, AFTER = RED, BLUE


def _sides(facts: CalibrationFacts) -> tuple[tuple[str, str], ...]:
    """Return the stages that are compared, by the names that the table of stages gives them, and their colours."""
    return (facts.placed_stage.name, BEFORE), (facts.written_stage.name, AFTER)


class CalibrationCharts(NamedTuple):
    """Every picture of the report, by the part of the page that shows it, each part in the page's order."""

    picture: tuple[Chart, ...]
    proof: tuple[Chart, ...]
    findings: tuple[Chart, ...]
    unseen: tuple[Chart, ...]
    correlations: tuple[Chart, ...]
    residuals: tuple[Chart, ...]
    computed: tuple[Chart, ...]

    @property
    def every(self) -> tuple[Chart, ...]:
        """All of them, in the page's order."""
        return tuple(chart for part in self for chart in part)


def draw_calibration_charts(facts: CalibrationFacts) -> CalibrationCharts:
    """Return every picture of the report."""
    drawn = [residual_chart(facts, kind) for kind in KINDS if any(a.kind == kind for a in facts.plot_variables)]
    if facts.calibration.run.samples.direction is not None:
        drawn.append(approach_chart(facts))
    released = facts.calibration.released
    errors = histogram_chart(facts)
    known = None if released is None else error_map_chart(facts, released)
    open_ = [] if released is None or misfit_place(released) is None else [misfit_chart(facts, released)]
    return CalibrationCharts(
        picture=(known or errors,),
        proof=(*([errors] if known else []), pose_chart(facts), stage_chart(facts)),
        findings=tuple(finding_chart(facts, told) for told in told_findings(facts) if told.steps),
        unseen=tuple(open_),
        correlations=(correlation_chart(facts),) if len(facts.calibration.fit.errors) > 1 else (),
        residuals=tuple(drawn),
        computed=tuple(history_charts(facts)),
    )


def histogram_chart(facts: CalibrationFacts) -> Chart:
    """How many samples have which held-out error, before and after: the first and last rows of the table of stages."""
    before, after = (to_mm(error_size(s.held_residual)) for s in (facts.placed_stage, facts.written_stage))
    low = max(float(np.quantile(after, 0.005)), float(before.max()) * 1e-6, 1e-7)
    high = 1.1 * max(float(before.max()), float(after.max()))
    unit = facts.calibration.reading_unit
    edges = np.geomspace(min(low, high / 10), high, 60 + 1)  # bins of the histogram
    series = []
    for (name, colour), error in zip(_sides(facts), (before, after), strict=True):
        share = 100 * np.histogram(np.clip(error, edges[0], edges[-1]), edges)[0] / len(error)
        label = f"{name}, mean {digits(float(error.mean()))} {unit}"
        series.append(Series(label, *histogram_outline(edges, share), colour, filled=True))
    labels = ("", f"held-out error ({unit}, logarithmic)", "part of the readings (%)")
    span, top = (float(edges[0]), float(edges[-1])), 1.1 * max(float(s.y.max()) for s in series)
    panel = Panel(*labels, tuple(series), log_x=True, x_range=span, y_range=(0.0, top), height=230)
    caption = "Each reading as predicted by a fit that had not seen it. One step of the scale is ten times less."
    return Chart("histogram", "Held-out error of the readings", caption, (panel,))


def pose_chart(facts: CalibrationFacts) -> Chart:
    """Error of every pose, before and after, in the order in which they were measured."""
    names, before, after = error_by_pose(facts)
    unit = facts.calibration.reading_unit
    floor = max(float(np.quantile(after, 0.02)) / 2, 1e-10)
    x = np.arange(1, len(names) + 1, dtype=float)
    series = []
    for (label, colour), values in zip(_sides(facts), (before, after), strict=True):
        hover = tuple(f"{n}: {digits(float(v))} {unit}" for n, v in zip(names, to_mm(values), strict=True))
        y = to_mm(np.maximum(values, floor))
        series.append(Series(label, x, y, colour, "points", hover=hover, size=5.0, opacity=0.8))
    moving = facts.calibration.run.continuous or facts.calibration.run.samples.pose is None
    what = "sample drawn" if moving else "pose"
    span = (float(to_mm(floor)) / 1.3, 1.5 * float(to_mm(max(before.max(), after.max()))))
    labels = ("", f"{what}, in the order of measuring", f"held-out error ({unit}, logarithmic)")
    panel = Panel(*labels, tuple(series), log_y=True, y_range=span, height=270)
    caption = f"Each {what} as predicted by a fit that had not seen it. Point at one for its number."
    return Chart("by_pose", f"Held-out error of each {what}", caption, (panel,))


def correlation_chart(facts: CalibrationFacts) -> Chart:
    """Draw the correlations of the fitted parameters; where there are many, those of the most correlated ones."""
    most = 60  # parameters in the correlation matrix
    matrix = facts.correlation
    strongest = np.abs(matrix - np.eye(len(matrix))).max(axis=1)
    kept = np.sort(np.argsort(-strongest, kind="stable")[:most])
    names = tuple(facts.calibration.fit.model.names[k] for k in kept)
    cells = Heatmap(matrix[np.ix_(kept, kept)], names)
    panel = Panel(y_names=names, cells=cells, height=max(240, 20 * len(names)))  # [px] of one name
    some = f"The {most} of {len(matrix)} that hang together most. " if len(matrix) > most else ""
    caption = (
        f"{some}Blue: two parameters err together; orange: in opposite senses. A strong colour means that the run "
        "knows the two better together than each by itself."
    )
    return Chart("correlation", "Which parameters hang together", caption, (panel,))


DRAWN_POSES = 400  # measured poses that are drawn
FIELD_HEIGHT = 190  # [px] of a map
LINE_HEIGHT = 170  # [px] of a line beneath it


def _reach_height(p: Array) -> tuple[Array, Array]:
    """Distance of points (n, 3) [m] from the axis of the base, and their height [mm]."""
    return to_mm(np.hypot(p[:, 0], p[:, 1])), to_mm(p[:, 2])


def error_map_chart(facts: CalibrationFacts, robot: ReleasedRobot) -> Chart:
    """Draw the tool's error by reach and height, before and after, in the same colours.

    It is what 95 of 100 robots like this one stay below at each state, with the tool of the summary's figure.
    """
    which = facts.summary.tool
    own = () if robot.work_tool is None else (robot.work_tool,)
    tools = {"measured": (robot.tool,), "own": own, "another": robot.other_tools}[which]
    reach, height = _reach_height(np.concatenate([t.position for t in tools]))
    before, after = (
        to_mm(np.concatenate([np.quantile(target_errors(robot, fit, t), ENOUGH, axis=1) for t in tools]))
        for fit in (None, robot.fit)
    )
    x, y, near = _neighbourhoods(reach, height)
    fields = [_blur(near, error) for error in (before, after)]
    most = max(float(np.nanmax(fields[0])), float(to_mm(facts.summary.targets_within_before or 0.0)))
    most = float(f"{most:.2g}")
    samples = facts.calibration.run.samples
    few = samples.take(even_positions(len(samples), DRAWN_POSES))
    poses = _reach_height(tool_position(few, facts.calibration.setup))
    measured = Series("", *poses, BLACK, "points", size=2.5, opacity=0.5)
    panels = tuple(
        Panel(
            title,
            "reach from axis 1 (mm)",
            label,
            (measured,),
            field=ColourField(x, y, field, "error (mm)", most),
            x_range=(0.0, 1.03 * float(reach.max())),
            y_range=(float(y[0]), float(y[-1])),
            height=FIELD_HEIGHT,
        )
        for title, label, field in (("before", "height (mm)", fields[0]), ("after", "", fields[1]))
    )
    caption = f"Error (mm) at each place, 95 % sure, with {TOOLS[which]}. Dots: measured poses."
    return Chart("expected_error", "Error over the workspace", caption, panels, columns=2)


def misfit_chart(facts: CalibrationFacts, robot: ReleasedRobot) -> Chart:
    """Draw what misfit leaves open by reach and height, and beside unnamed motion along every joint."""
    moved, q = to_mm(misfit_motion(robot)), to_deg(robot.tool.q)
    left = to_mm(np.sqrt(open_misfit(robot, error_parts(robot))))
    reach, height = _reach_height(robot.tool.position)
    x, y, near = _neighbourhoods(reach, height)
    samples = facts.calibration.run.samples
    few = samples.take(even_positions(len(samples), DRAWN_POSES))
    poses = _reach_height(tool_position(few, facts.calibration.setup))
    measured = Series("measured poses", *poses, BLACK, "points", size=3.0, opacity=0.6)
    field = Panel(
        f"misfit, left open: {digits(float(np.sqrt((left**2).mean())))} mm rms over the workspace",
        "reach from axis 1 (mm)",
        "height (mm)",
        (measured,),
        field=ColourField(x, y, _blur(near, left), "misfit (mm)"),
        x_range=(0.0, 1.03 * float(reach.max())),
        y_range=(float(y[0]), float(y[-1])),
        height=FIELD_HEIGHT,
    )
    seen, units = to_deg(few.q), facts.calibration.setup.robot.joint_units
    joints = tuple(
        Panel(
            "",
            f"joint {j + 1} ({units[j]})",
            "mm, rms" if j % 2 else "",  # beside the colours of the field there is no room
            (
                _rms_line("misfit, left open", left, RED, q[:, j]),
                _rms_line("unnamed motion, seen", moved, GREY, q[:, j]),
                Series("measured poses", seen[:, j], np.zeros(len(seen)), BLACK, "points", size=3.0, opacity=0.6),
            ),
            height=LINE_HEIGHT,
        )
        for j in range(q.shape[1])
    )
    caption = (
        "Misfit is the part of the error that causes without a name leave open; unnamed motion is what the run shows "
        "of them. Points are measured poses: where misfit is large and points are few, measure next."
    )
    return Chart("misfit", "Misfit: what causes without a name leave open", caption, (field, *joints), columns=2)


def _rms_line(name: str, error: Array, colour: str, along: Array) -> Series:
    x, square = weighted_means(along, error**2, most=14)  # points of the line
    return Series(name, x, np.sqrt(square), colour, width=2.0)


def _neighbourhoods(reach: Array, height: Array) -> tuple[Array, Array, Array]:
    """Return middles of squares (c,) and (r,) [mm], and weights of the states there (r, c, n), zero far from all."""
    across = 56  # squares of the map from the axis of joint 1 to the longest reach
    step = float(reach.max()) / across
    x = np.asarray(step * (np.arange(across + 2) + 0.5))
    y = np.arange(float(height.min()) - step, float(height.max()) + 2 * step, step)
    square = (x[None, :, None] - reach) ** 2 + (y[:, None, None] - height) ** 2
    width = 0.055 * float(reach.max())  # of the longest reach: width of the neighbourhood that a square is the mean of
    near = square.min(axis=2, keepdims=True) < (1.3 * width) ** 2
    return x, np.asarray(y), np.where(near, np.exp(-0.5 * square / width**2), 0.0)


def _blur(weight: Array, error: Array) -> Array:
    """Root mean square of errors (n,) by weight (r, c, n), not a number where nothing weighs."""
    total = weight.sum(axis=2)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.sqrt(weight @ error**2 / np.where(total > 0, total, np.nan)))
