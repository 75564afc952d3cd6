"""Histograms of position errors, as the TriCal paper's figure 9, and the scatter of repeated centrings."""

import numpy as np

from planner.accuracy import Repeats, Validation
from planner.accuracy.mastering import TOLERANCE
from planner.accuracy.validation import Judged
from planner.report.picture import BLUE, ORANGE, Limit, Panel, Picture, Series
from planner.units import UM, Array, to_mm

BINS = 25
ROW = 26  # [px] of one pose
ROOM = 1.25  # of the highest bar, for what is written beside the lines


def histogram(found: Validation) -> Picture:
    """Errors before and after calibration, each on an axis of its own."""
    both = [("by the data sheet", ORANGE, found.before)]
    if found.after is not None:
        both.append(("calibrated", BLUE, found.after))
    caption = (
        "Distance between where the tracker saw the reflector and where the robot's model has it, one a pose; dotted: "
        "mean and largest. The tracker's frame comes from the nests, never from these poses."
    )
    panels = tuple(_panel(*one) for one in both)
    return Picture("accuracy", f"Position errors at {len(found.run)} poses", caption, panels)


def _panel(name: str, colour: str, judged: Judged) -> Panel:
    size = to_mm(np.linalg.norm(judged.error, axis=1))
    edges = np.linspace(0.0, float(size.max()), BINS + 1)
    counts = np.histogram(size, edges)[0].astype(float)
    mean, largest = float(to_mm(judged.figures.mean)), float(to_mm(judged.figures.largest))
    return Panel(
        name,
        "position error (mm)",
        "poses",
        (_steps(name, colour, edges, counts),),
        (Limit(mean, f"mean {mean:.3f}", upright=True), Limit(largest, f"max {largest:.3f}", upright=True)),
        x_range=(0.0, 1.12 * largest),
        y_range=(0.0, ROOM * float(counts.max())),
        height=240,
    )


def _steps(name: str, colour: str, edges: Array, counts: Array) -> Series:
    """The outline of a histogram, filled."""
    x = np.repeat(edges, 2)
    y = np.concatenate([[0.0], np.repeat(counts, 2), [0.0]])
    return Series(name, x, y, colour, filled=True)


def scatter(found: Repeats) -> Picture:
    """How far every repeated centring is from the mean of its pose, one row a pose."""
    poses = list(dict.fromkeys(int(p) for p in found.pose))
    size = np.linalg.norm(found.off, axis=1) / UM
    place = np.array([poses.index(int(p)) for p in found.pose], dtype=float)
    ball = dict(zip(found.pose.tolist(), found.ball, strict=True))
    hover = tuple(f"pose {p}: {v:.1f} µm" for p, v in zip(found.pose, size, strict=True))
    panel = Panel(
        "",
        "distance from the mean of the pose (µm)",
        "",
        (Series("", size, place, BLUE, "points", hover=hover),),
        (Limit(TOLERANCE / UM, f"centred to {TOLERANCE / UM:g} µm by the indicators", upright=True),),
        x_range=(0.0, 1.15 * max(float(size.max()), 2 * TOLERANCE / UM)),
        y_names=tuple(f"pose {p}, ball {ball[p]}" for p in poses),
        height=ROW * len(poses) + 40,
    )
    caption = (
        "Each centring from the mean of all of its pose. The arm's own repeatability, which its joint angles do not "
        "show, is part of it: the indicators alone agree much more closely."
    )
    return Picture("accuracy", "Repeated centrings", caption, (panel,))
