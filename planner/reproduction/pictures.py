"""Pictures of the page, the paper at the left and ours at the right; the paper's are drawn from its printed numbers."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from planner.report.chart import BLUE, GREY, ORANGE
from planner.report.matplotlib_backend import figure_png, print_style
from planner.reproduction.published import paper_numbers
from planner.reproduction.rows import Numbers

Group = Mapping[str, Any]


def draw_pictures(numbers: Numbers) -> dict[str, bytes]:
    """Return every picture as a PNG by its name."""
    return {name: draw_picture(name, numbers) for name, (_, group, _) in PICTURES.items() if group in numbers}


def draw_picture(name: str, numbers: Numbers) -> bytes:
    """Return one picture as a PNG."""
    _, group, draw = PICTURES[name]
    with print_style():
        figure = Figure(figsize=(8.0, 3.0), layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True)
        draw(left, right, numbers[group])
        left.set_title("paper", fontsize=10)
        right.set_title("edbb", fontsize=10)
        return figure_png(figure, small=True)


def _pruning(left: Axes, right: Axes, plan: Group) -> None:
    """Fig. 5: of the paper only the place of the optimum is in its text."""
    right.plot(plan["sizes"], plan["curve"], color=BLUE)
    right.axvline(plan["knee"], color=GREY, linestyle="--", linewidth=1)
    right.text(plan["knee"] + 3, max(plan["curve"]), f"{plan['knee']} poses", va="top", fontsize=8)
    left.axvline(35, color=GREY, linestyle="--", linewidth=1)
    left.text(38, max(plan["curve"]), "optimum near 35 poses\n(no values in the text)", va="top", fontsize=8)
    left.set(xlabel="poses", ylabel="condition number O2 (m, rad)", xlim=(15, 200))
    right.set(xlabel="poses", xlim=(15, 200))


def _tour(left: Axes, right: Axes, plan: Group) -> None:
    """Fig. 6: time of the tour before and after it is ordered."""
    for axis, values in ((left, (240.0, 22.0)), (right, (plan["unsorted_s"], plan["sorted_s"]))):
        _bars(axis, ("unsorted", "sorted"), values, "{:.0f} s")
    left.set_ylabel("time by the slowest axis (s)")


def _circle_and_path(left: Axes, right: Axes, plan: Group) -> None:
    """Figs 11 and 12: how much of the bar is used, and how much deviation shows."""
    names = ("circle:\nlength", "circle:\ndeviation", "path:\nlength", "path:\ndeviation")
    keys = [f"{which}_{what}" for which in ("circle", "path") for what in ("length", "deviation")]
    ours = np.array([plan[f"{key}_mm"] for key in keys])
    circle, path = paper_numbers().circle, paper_numbers().path
    theirs = (circle.length_mm, circle.deviation_mm, path.length_mm, path.deviation_mm)
    _bars(left, names, theirs, "{:.2f}")
    low, high = (np.array([plan[f"{key}_{end}_mm"] for key in keys]) for end in ("low", "high"))
    _bars(right, names, ours, "{:.2f}", tops=1.05 * high)
    right.errorbar(range(4), ours, [ours - low, high - ours], fmt="none", color=GREY, capsize=3)
    left.set_yscale("log")
    left.set_yticks([1, 10, 100], ["1", "10", "100"])
    left.set_ylabel("range (mm)")
    left.set_ylim(1, 400)


def _sine(left: Axes, right: Axes, loaded: Group) -> None:
    """Fig. 14b and eq. 9: the averaged curve and the sine."""
    theta = np.linspace(0, 360, 361)
    sine = paper_numbers().sine
    theirs = sine.a_mm * np.sin(np.radians(sine.b * theta - sine.phase_deg))
    left.plot(theta, theirs, color=ORANGE, label=f"eq. 9, b = {sine.b}")
    right.plot(loaded["averaged_deg"], loaded["averaged_mm"], color=BLUE, label="averaged curve")
    fitted = loaded["sine_mm"] * np.sin(np.radians(loaded["sine_b"] * theta - loaded["sine_deg"]))
    right.plot(theta, fitted, color=ORANGE, linestyle="--", label=f"eq. 9, b = {loaded['sine_b']:.3f}")
    for axis in (left, right):
        axis.set_xlabel("angle on the circle (°)")
        axis.set_xticks([0, 90, 180, 270, 360])
        axis.legend(fontsize=8, loc="upper right")
    left.set_ylabel("length (mm)")


def _accuracy(left: Axes, right: Axes, accuracy: Group) -> None:
    """Fig. 9 and Table 9: position errors at 500 poses."""
    names = ("mean", "maximum", "std")
    head, tracker = paper_numbers().table_9.head_mm, paper_numbers().table_9.tracker_mm
    for shift, which, key, theirs, colour in (
        (-0.2, "TriCal", "head", head, BLUE), (0.2, "laser tracker", "tracker", tracker, ORANGE),
    ):  # fmt: skip
        ours = [accuracy[f"{key}_{what}_mm"] for what in ("mean", "max", "std")]
        for axis, values in ((left, theirs), (right, ours)):
            axis.bar(np.arange(3) + shift, values, 0.38, color=colour, label=which)
            for k, value in enumerate(values):
                axis.text(k + shift, value, f"{value:.3f}", ha="center", va="bottom", fontsize=7.5)
    for axis in (left, right):
        axis.set_xticks(range(3), names)
    left.legend(fontsize=8)
    left.set_ylabel("position error (mm)")


def _bars(axis: Axes, names: tuple[str, ...], values: Any, form: str, tops: Any = None) -> None:
    """Draw a bar each, with its value above the bar or above ``tops``."""
    axis.bar(range(len(names)), values, 0.6, color=BLUE)
    axis.set_xticks(range(len(names)), names, fontsize=8)
    for k, (value, top) in enumerate(zip(values, values if tops is None else tops, strict=True)):
        axis.text(k, top, form.format(value), ha="center", va="bottom", fontsize=8)


PICTURES: Mapping[str, tuple[str, str, Callable[[Axes, Axes, Group], None]]] = {
    "pruning": ("EDBB paper, Fig. 5: condition number over the number of poses", "plan", _pruning),
    "tour": ("EDBB paper, Fig. 6: time of the tour before and after it is ordered", "plan", _tour),
    "circle_and_path": (
        "EDBB paper, Figs 11 and 12: range of the bar's length, and of its deviation (bars: 5 to 95 % of 20 robots)",
        "plan",
        _circle_and_path,
    ),
    "sine": ("EDBB paper, Fig. 14b and eq. 9: the circle's offset", "loaded", _sine),
    "accuracy": ("TriCal paper, Fig. 9 and Table 9: position errors at 500 poses", "accuracy", _accuracy),
}
"""Title, group of numbers and drawing of each picture, in the order of the page."""
