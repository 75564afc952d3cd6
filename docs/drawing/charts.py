"""Charts of the figures in ``docs/pictures/shown``: before and after, stage by stage, what was planned."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from planner.report.chart import BLUE, GREY, ORANGE, RED
from planner.report.matplotlib_backend import figure_png, print_style

SHOWN = Path(__file__).resolve().parents[1] / "pictures" / "shown"
WIDTH, HEIGHT = 8.0, 3.2  # [inch]
TICKS = (1.0, 2.0, 4.0, 6.0, 8.0)  # first digits that a logarithmic axis says
PLAIN = FuncFormatter(lambda v, _: f"{v:g}" if float(f"{v:.0e}"[0]) in TICKS else "")
PUBLISHED = {"ur5": (2.566, 0.155), "panda": (7.79, 0.347)}  # mean errors before and after, as published [mm]


def shown(name: str) -> dict[str, Any]:
    """Return the figures of a public run."""
    found: dict[str, Any] = json.loads((SHOWN / f"{name}.json").read_text(encoding="utf-8"))
    return found


def ur5_before_after() -> bytes:
    """Return the errors at the 20 poses kept apart: nominal and calibrated robot."""
    errors, last = shown("ur5")["errors_mm"], shown("ur5")["last"]
    before, after = np.array(errors["nominal"]), np.array(errors[last])
    with print_style():
        figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
        ax = figure.subplots()
        at = np.arange(1, len(before) + 1)
        ax.bar(at - 0.2, before, 0.4, color=RED, label=f"data sheet: mean {before.mean():.2f} mm")
        ax.bar(at + 0.2, after, 0.4, color=BLUE, label=f"calibrated: mean {after.mean():.3f} mm")
        _published(ax, "ur5")
        ax.set(xlabel="pose that took no part in the fit", ylabel="error (mm)", xticks=at, xlim=(0.3, len(at) + 0.7))
        ax.set_title("A real UR5 and a laser tracker: 1000 poses fitted, 20 kept apart", pad=24)
        _legend(ax, 3)
        return figure_png(figure, small=True)


def panda_before_after() -> bytes:
    """Return the mean error of each placement that the fit never saw."""
    data = shown("panda")
    before, after = (data["mean_mm"][k] for k in ("nominal", data["last"]))
    with print_style():
        figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
        ax = figure.subplots()
        at = np.arange(len(before["each"]))
        ax.bar(at - 0.2, before["each"], 0.4, color=RED, label=f"URDF: mean {before['all']:.2f} mm")
        ax.bar(at + 0.2, after["each"], 0.4, color=BLUE, label=f"calibrated: mean {after['all']:.3f} mm")
        _published(ax, "panda")
        ax.set_xticks(at, [str(k + 1) for k in at])
        ax.set(xlabel="placement of the plate that took no part in the fit", ylabel="mean error (mm)")
        ax.set_title("A real Panda and a printed plate: one placement fitted, seven kept apart", pad=24)
        _legend(ax, 3)
        return figure_png(figure, small=True)


def stages(name: str, title: str) -> bytes:
    """Return the mean error after each stage of a run's fit."""
    rows = shown(name)["stages"]
    held = np.array([r["held_out_mean_mm"] for r in rows])
    apart = np.array([r["validation_mean_mm"] or np.nan for r in rows])
    with print_style():
        figure = Figure(figsize=(WIDTH, 1.3 + 0.28 * len(rows)), layout="constrained")
        ax = figure.subplots()
        at = np.arange(len(rows))
        ax.plot(held, at, "o-", color=BLUE, label="held-out groups of the run")
        if np.isfinite(apart).any():
            ax.plot(apart, at, "s--", color=ORANGE, label="poses kept apart")
        ax.set_xscale("log")
        ax.xaxis.set_major_formatter(PLAIN)
        ax.xaxis.set_minor_formatter(PLAIN)
        ax.tick_params(axis="x", which="both", labelsize=8)
        ax.set_yticks(at, [f"{r['name']} ({r['parameters']})" for r in rows])
        ax.invert_yaxis()
        ax.grid(visible=True, axis="x", which="both")
        ax.set_xlabel("mean error (mm)")
        ax.set_title(title, pad=24)
        _legend(ax, 2)
        return figure_png(figure, small=True)


def _published(ax: Any, name: str) -> None:
    _, after = PUBLISHED[name]
    ax.axhline(after, color=GREY, linewidth=1.0, linestyle=":", label=f"published, after: {after} mm")


def _legend(ax: Any, columns: int) -> None:
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1.0), ncols=columns, borderaxespad=0.1)


def plan_charts(plan: Path) -> bytes:
    """Return the candidates that each filter leaves, and the index beside its bound, of a stored plan."""
    document = json.loads(plan.read_text(encoding="utf-8"))
    funnel = {k.replace("_", " "): v for k, v in document["funnel"].items() if isinstance(v, int) and v}
    seen = document["observability"]
    with print_style():
        figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=(3, 2))
        left.barh(range(len(funnel)), list(funnel.values()), color=BLUE)
        left.set_yticks(range(len(funnel)), list(funnel))
        left.invert_yaxis()
        left.set_xscale("log")
        left.xaxis.set_minor_formatter(NullFormatter())
        left.set(title="Candidates that each filter leaves", xlabel="poses")
        both = [seen["on_grid"]["value"], seen["bound"]]
        right.bar(["chosen poses", "no choice is better"], both, color=[BLUE, GREY])
        right.set(title=f"{seen['index']}: {100 * seen['on_grid']['gap']:.1f} % from the proven bound")
        return figure_png(figure, small=True)
