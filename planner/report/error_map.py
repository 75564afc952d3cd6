"""The tool's expected error over the workspace: a map by reach and height, before and after."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from planner.common.determinism import even_positions
from planner.common.units import Array, to_mm
from planner.identification.released_robot import ReleasedRobot
from planner.model.tool_error import tool_position
from planner.report.calibration_data import CalibrationFacts
from planner.report.chart import BLACK, BLUE, GREY, ORANGE, Chart, ColourField, Panel, Series, weighted_means
from planner.report.formatting import digits

ACROSS = 56  # squares of the map from the axis of joint 1 to the longest reach
BLUR = 0.055  # of the longest reach: width of the neighbourhood that a square is the mean of
POSES, MEANS = 400, 14  # measured poses that are drawn, points of the lines
FIELD_HEIGHT, LINE_HEIGHT = 300, 170


@dataclass(frozen=True)
class WorkspaceErrors:
    """Reach and height of n states [mm], (n,), and expected error there of nominal robot, geometry, released robot."""

    reach: Array
    height: Array
    nominal: Array
    geometry: Array
    released: Array

    @classmethod
    def of(cls, robot: ReleasedRobot) -> "WorkspaceErrors":
        """Take the states at which the robot is judged."""
        errors = (to_mm(robot.expected_errors(fit)) for fit in (None, robot.geometry, robot.fit))
        return cls(*_reach_height(robot.tool.position), *errors)


def _reach_height(p: Array) -> tuple[Array, Array]:
    """Distance of points (n, 3) [m] from the axis of the base, and their height [mm]."""
    return to_mm(np.hypot(p[:, 0], p[:, 1])), to_mm(p[:, 2])


def error_map_chart(facts: CalibrationFacts, robot: ReleasedRobot) -> Chart:
    """Draw the expected error by reach and height, before and after, and along each of the two."""
    at = WorkspaceErrors.of(robot)
    x, y, near = _neighbourhoods(at.reach, at.height)
    samples = facts.calibration.run.samples
    few = samples.take(even_positions(len(samples), POSES))
    poses = _reach_height(tool_position(few, facts.calibration.fit.model.setup))
    edge: dict[str, Any] = {"x_range": (0.0, 1.03 * float(at.reach.max())), "y_range": (float(y[0]), float(y[-1]))}
    labels = ("reach from the axis of the base (mm)", "height (mm)")
    measured = Series("measured poses", *poses, BLACK, "points", size=3.0, opacity=0.6)
    fields = tuple(
        Panel(
            f"{title}: {digits(float(np.sqrt((error**2).mean())))} mm rms",
            labels[0],
            height,
            (measured,),
            field=ColourField(x, y, _blur(near, error), "expected error (mm)"),
            height=FIELD_HEIGHT,
            **edge,
        )
        for title, height, error in (("nominal", labels[1], at.nominal), ("calibrated", "", at.released))
    )
    lines = tuple(
        Panel("", label, what, _lines(at, along), log_y=True, height=LINE_HEIGHT)
        for label, what, along in ((labels[0], "expected error (mm, rms)", at.reach), (labels[1], "", at.height))
    )
    caption = (
        "Error of the measured tool point that the run leaves to be expected, in any posture, the base aligned anew. "
        "Each side has colours of its own. Points are measured poses: far from them the run knows less."
    )
    return Chart("expected_error", "Error to be expected over the workspace", caption, (*fields, *lines), columns=2)


def _lines(at: WorkspaceErrors, along: Array) -> tuple[Series, ...]:
    out = []
    kinds = (("nominal", at.nominal, ORANGE), ("geometry", at.geometry, GREY), ("calibrated", at.released, BLUE))
    for name, error, colour in kinds:
        x, square = weighted_means(along, error**2, most=MEANS)
        out.append(Series(name, x, np.sqrt(square), colour, width=2.0))
    return tuple(out)


def _neighbourhoods(reach: Array, height: Array) -> tuple[Array, Array, Array]:
    """Return middles of squares (c,) and (r,) [mm], and weights of the states there (r, c, n), zero far from all."""
    step = float(reach.max()) / ACROSS
    x = np.asarray(step * (np.arange(ACROSS + 2) + 0.5))
    y = np.arange(float(height.min()) - step, float(height.max()) + 2 * step, step)
    square = (x[None, :, None] - reach) ** 2 + (y[:, None, None] - height) ** 2
    width = BLUR * float(reach.max())
    near = square.min(axis=2, keepdims=True) < (1.3 * width) ** 2
    return x, np.asarray(y), np.where(near, np.exp(-0.5 * square / width**2), 0.0)


def _blur(weight: Array, error: Array) -> Array:
    """Root mean square of errors (n,) by weight (r, c, n), not a number where nothing weighs."""
    total = weight.sum(axis=2)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.sqrt(weight @ error**2 / np.where(total > 0, total, np.nan)))
