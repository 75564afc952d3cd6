"""The share of simulated arms whose bound is below a goal, against minutes, by the way in which poses are chosen."""

import json
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from planner.report.chart import BLUE, GREY, ORANGE, RED
from planner.report.matplotlib_backend import figure_png, print_style

SHOWN = Path(__file__).resolve().parents[1] / "pictures" / "shown" / "stopping.json"
LINES = {
    "led on": (BLUE, "-"), "measure": (BLUE, "--"), "batches": (ORANGE, "-"), "batches anew": (ORANGE, "--"),
    "next-view": (RED, "-"), "plan": (GREY, "-"), "by the minute": (GREY, "-."), "d-optimal": (GREY, "--"),
    "next-view set": (GREY, ":"), "plan's own number": (GREY, "-"),
}  # fmt: skip


def stopping_curves(goal: str) -> bytes:
    """Return the curves of a goal [mm] of ``stopping.json``, which has the minutes of each arm, none if never."""
    data = json.loads(SHOWN.read_text(encoding="utf-8"))
    with print_style():
        figure = Figure(figsize=(8.0, 3.6), layout="constrained")
        ax = figure.subplots()
        of_way = data["minutes"][goal]
        for way, (colour, style) in LINES.items():
            if way not in of_way:
                continue
            minutes = np.sort([np.inf if m is None else m for m in of_way[way]])
            reached = minutes[np.isfinite(minutes)]
            share = 100.0 * np.arange(1, len(reached) + 1) / len(minutes)
            ax.step(np.append(0.0, reached), np.append(0.0, share), color=colour, ls=style, where="post", label=way)
        ax.set(xlabel="minutes at the cell", ylabel="arms below it (%)", ylim=(0, 100), xlim=(0, None))
        ax.set_title(f"{data['arms']} simulated arms: stated to be below {goal} mm with 95 %")
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
        return figure_png(figure, small=True)
