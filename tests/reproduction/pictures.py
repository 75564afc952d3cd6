"""The pictures of the page."""

import matplotlib
import matplotlib.pyplot as plt
import numpy as np

from tests.reproduction.table9 import PUBLISHED

matplotlib.use("Agg")


COLOURS = {"laser tracker": "#7a3e9d", "TriCal": "#1b7f79", "ball bar": "#d95f02"}


def histogram(path, table):
    """Errors at the validation poses, as in Figure 9."""
    shown = [r for r in table if r.measured.name in PUBLISHED]
    figure, axes = plt.subplots(1, len(shown), figsize=(3.2 * len(shown), 2.8), sharey=True, layout="constrained")
    for axis, row in zip(axes, shown, strict=True):
        axis.hist(1e3 * row.errors.of, np.linspace(0, 1.0, 26), color=COLOURS[row.measured.name])
        mean, largest, _ = row.errors.row
        title = f"{row.measured.name}{', traced' * row.traced}"
        axis.set_title(f"{title}\nmean {mean:.3f}, max {largest:.3f} mm", fontsize=9)
        axis.set_xlabel("position error (mm)")
    axes[0].set_ylabel("poses")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def against_time(path, table):
    """Error against minutes of robot time; what the equipment costs stands beside each point."""
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), sharex=True, layout="constrained")
    for axis, which, name in zip(axes, (0, 1), ("mean", "maximum"), strict=True):
        for kind, colour in COLOURS.items():
            for traced in (False, True):
                own = [r for r in table if kind in r.measured.name and r.traced == traced]
                axis.plot(
                    [r.measured.minutes for r in own], [r.errors.row[which] for r in own], "o" if traced else "x",
                    color=colour, label=f"{kind}{', traced' * traced}, {_euros(own)}", markersize=7,
                )  # fmt: skip
        level = PUBLISHED["laser tracker"][which]
        axis.axhline(level, color="#555555", linestyle="--", linewidth=1)
        axis.text(
            0.6, level, "tracker of the paper", fontsize=8, ha="center", va="bottom",
            transform=axis.get_yaxis_transform(),
        )  # fmt: skip
        axis.set_yscale("log")
        axis.yaxis.set_major_formatter("{x:g}")
        axis.yaxis.set_minor_formatter(lambda v, _: f"{v:g}" if f"{v:e}"[0] in "25" else "")
        axis.set_xlabel("robot time (min)")
        axis.set_ylabel(f"{name} position error at 500 poses (mm)")
    axes[0].legend(fontsize=8)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _euros(rows):
    ends = sorted({r.measured.euros for r in rows})
    return " to ".join(f"{v:,.0f}".replace(",", " ") for v in dict.fromkeys((ends[0], ends[-1]))) + " €" if ends else ""
