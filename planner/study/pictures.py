"""The study's pictures of one cell as it is: what is seen, index curves, sensitivity and correlation."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from planner.common.units import MM, UM
from planner.design.observability.information import INDEX_RULES
from planner.report.chart import BLUE, GREY, ORANGE, RED
from planner.report.matplotlib_backend import figure_png, print_style
from planner.study.basis import BoundedCurve, StudyBasis, find_curve
from planner.study.summary import format_number
from planner.study.tables import MDEG, find_absorbers, prior_size_effects

LOUD = 0.9  # a correlation from which two parameters are hard to tell apart
ROW = 0.2  # [inch] a parameter's line


def draw_identifiability(basis: StudyBasis) -> bytes:
    """Singular values with their gap, and each parameter's predicted standard deviation against its prior."""
    with print_style():
        figure = Figure(figsize=(11.0, 1.6 + ROW * len(basis.whole.names)), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=[1, 1.45])
        _draw_spectrum(left, basis)
        _draw_shares(right, basis)
        return figure_png(figure)


def _draw_spectrum(ax: Axes, basis: StudyBasis) -> None:
    mu, rank = basis.seen.spectrum / UM, basis.seen.rank
    mu = np.maximum(mu, mu[0] * 1e-17)
    at = np.arange(1, len(mu) + 1)
    ax.semilogy(at[:rank], mu[:rank], "o", color=BLUE, markersize=4.5, label="seen")
    if rank < len(mu):
        ax.semilogy(at[rank:], mu[rank:], "x", color=RED, markersize=6, label="not seen")
        middle = float(np.sqrt(mu[rank - 1] * mu[rank]))
        says = f"gap of 10$^{{{np.log10(basis.seen.gap):.0f}}}$" if np.isfinite(basis.seen.gap) else "gap"
        ax.annotate(says, (rank + 0.3, middle), ha="right")
        ax.vlines(rank + 0.5, mu[rank], mu[rank - 1], color=GREY, linewidth=0.8)
    noise = basis.noise / np.sqrt(basis.poses) / UM
    ax.axhline(noise, color="#666666", linewidth=0.8, linestyle=":")
    says = f"noise of a reading, mean of {basis.poses}: {format_number(noise)} µm"
    ax.annotate(says, (1, noise), (0, -3), textcoords="offset points", va="top", fontsize=8.5, color="#555555")
    ax.set_title(f"{rank} of {len(mu)} directions are seen")
    ax.set_xlabel("direction, strongest first")
    ax.set_ylabel("rms change of a reading by one prior size (µm)")
    ax.grid(visible=True, axis="y")
    ax.legend(loc="center left")


def _draw_shares(ax: Axes, basis: StudyBasis) -> None:
    names, prior = basis.whole.names, basis.whole.prior
    std = dict(zip(basis.seen.names, basis.predicted.std, strict=True))
    why = {d.name: d.because for d in basis.seen.dropped}
    carried = find_absorbers(basis)
    share = {n: 100 * std[n] / p for n, p in zip(names, prior, strict=True) if n in std}
    least, worst = min(share.values()), max(share.values())
    for k, name in enumerate(names):
        if name in share:
            ax.plot([least / 3, share[name]], [k, k], color="#DDDDDD", linewidth=0.8)
            ax.plot(share[name], k, "o", color=BLUE, markersize=4.5)
            says = format_in_unit(std[name], basis.whole.parameters[k].unit)
            says += ", carries " + ", ".join(carried[name]) if carried[name] else ""
            _annotate_beside(ax, says, (share[name], k), "#555555")
        else:
            ax.plot(least / 2.6, k, "x", color=RED, markersize=5)
            reason = why[name].split(":")[0].removeprefix(name + " ")
            _annotate_beside(ax, reason, (least / 2.6, k), RED)
    ax.set_xscale("log")
    ax.set_xlim(least / 3, max(200.0, 2 * worst))
    ticks = [t for t in (0.1, 0.3, 1, 3, 10, 30, 100) if t > least / 3]
    ax.set_xticks(ticks, [f"{t:g}" for t in ticks])
    ax.minorticks_off()
    ax.axvline(100, color="#666666", linewidth=0.8, linestyle=":")
    ax.annotate("prior", (100, -0.9), (-3, 0), textcoords="offset points", ha="right", va="center", fontsize=8.5)
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.4, -1.4)
    last = max(share, key=lambda n: share[n])
    ax.set_title(f"After {basis.poses} poses the least certain, {last}, is known to {worst:.0f} % of its prior")
    ax.set_xlabel("predicted σ after one measurement (% of prior σ)")
    ax.grid(visible=True, axis="x")


def _annotate_beside(ax: Axes, text: str, at: tuple[float, float], colour: str) -> None:
    ax.annotate(text, at, (7, 0), textcoords="offset points", va="center", fontsize=8, color=colour)


def format_in_unit(value: float, unit: str) -> str:
    """Return a length in mm or an angle in thousandths of a degree, with two digits."""
    return f"{value / MM:.2g} mm" if unit == "m" else f"{value / MDEG:.2g} mdeg"


def draw_curves(basis: StudyBasis) -> bytes:
    """Small multiples: one index a column, raw above, unit-free below."""
    with print_style():
        figure = Figure(figsize=(14.0, 5.6), layout="constrained")
        grid = figure.subplots(2, len(INDEX_RULES), sharex=True)
        for row, scaled in zip(grid, (False, True), strict=True):
            for ax, index in zip(row, INDEX_RULES, strict=True):
                _draw_curve(ax, find_curve(basis.curves, index, scaled))
        for ax in grid[1]:
            ax.set_xlabel("number of poses")
        grid[0, 0].set_ylabel("raw (m, rad)")
        grid[1, 0].set_ylabel("unit-free (by prior sizes)")
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
        own = find_curve(basis.curves, basis.index, scaled=False)
        gap = 100 * INDEX_RULES[own.index].gap(own.at_knee, own.limit_at_knee)
        any_set = "any number of poses" if own.index in ("O1", "O2") else f"any {own.knee} poses"
        says = f"{own.index} bends at {own.knee} poses, where it is within {gap:.0f} % of what {any_set} can reach"
        figure.suptitle(says, x=0.01, ha="left")
        return figure_png(figure)


def _draw_curve(ax: Axes, curve: BoundedCurve) -> None:
    limit = "no set of candidates is better (proven)"
    power = 10.0 ** (3 * np.floor(np.log10(max(curve.values.max(), curve.bounds.max())) / 3))
    power = 1.0 if 1e-3 <= power <= 1.0 and curve.values.max() >= 0.01 else power
    ax.plot(curve.sizes, curve.bounds / power, color=ORANGE, linewidth=1.4, linestyle="--", label=limit)
    ax.plot(curve.sizes, curve.values / power, "-o", color=BLUE, linewidth=1.2, markersize=3, label="selected poses")
    at = int(np.flatnonzero(curve.sizes == curve.knee)[0])
    bend = curve.values[at] / power
    ax.plot(curve.knee, bend, "o", markersize=9, markerfacecolor="none", color=RED, label="where it bends")
    best = "higher" if INDEX_RULES[curve.index].maximise else "lower"
    unit = "" if power == 1.0 else f" (10$^{{{round(np.log10(power))}}}$)"
    ax.set_title(f"{curve.index}{unit}, {best} is better", fontsize=9.5)
    below = (3, -11) if INDEX_RULES[curve.index].maximise else (5, 6)
    ax.annotate(str(curve.knee), (curve.knee, bend), below, textcoords="offset points", color=RED)
    ax.set_xscale("log")
    ticks = [n for n in (20, 30, 50, 100, 200, 400) if curve.sizes[0] * 0.9 <= n <= curve.sizes[-1] * 1.1]
    ax.set_xticks(ticks, [str(n) for n in ticks])
    ax.minorticks_off()
    ax.grid(visible=True, axis="y")


def draw_sensitivity(basis: StudyBasis) -> bytes:
    """Sorted bars of each parameter's effect on the reading, and the correlations at the chosen poses."""
    with print_style():
        figure = Figure(figsize=(13.0, 2.0 + ROW * len(basis.whole.names)), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=[1, 1.35])
        _draw_bars(left, basis)
        _draw_correlation(figure, right, basis)
        return figure_png(figure)


def _draw_bars(ax: Axes, basis: StudyBasis) -> None:
    rms, most = (v / UM for v in prior_size_effects(basis))
    order = np.lexsort((np.arange(len(rms)), -np.round(rms, 6)))
    names, seen = [basis.whole.names[k] for k in order], set(basis.seen.names)
    at = np.arange(len(order))
    for says, colour, those in (
        ("identified", BLUE, [n in seen for n in names]),
        ("held at its nominal value", GREY, [n not in seen for n in names]),
    ):
        mask = np.array(those)
        ax.barh(at[mask], rms[order][mask], height=0.65, color=colour, label=f"rms, {says}")
    ax.plot(most[order], at, "|", color=ORANGE, markersize=8, markeredgewidth=1.8, label="largest of all candidates")
    ax.set_yticks(at, names)
    ax.set_ylim(len(at) - 0.4, -0.6)
    ax.set_xlim(0, 1.05 * most.max())
    ax.set_title(f"{names[0]} moves the reading most, {rms[order][0]:.0f} µm")
    ax.set_xlabel("change of the reading by one prior size (µm)")
    ax.grid(visible=True, axis="x")
    ax.legend(loc="lower right", frameon=True, framealpha=1.0, edgecolor="none")


def _draw_correlation(figure: Figure, ax: Axes, basis: StudyBasis) -> None:
    rho, names = basis.predicted.correlation, basis.seen.names
    image = ax.imshow(rho, cmap="PuOr", vmin=-1, vmax=1, interpolation="nearest", aspect="auto")
    loud = [(j, k) for j in range(len(names)) for k in range(len(names)) if j != k and abs(rho[j, k]) >= LOUD]
    for j, k in loud:
        ax.plot(k, j, "o", color="white", markersize=3)
    ax.set_xticks(range(len(names)), names, rotation=90, fontsize=8)
    ax.set_yticks(range(len(names)), names, fontsize=8)
    ax.spines[:].set_visible(False)
    ax.tick_params(length=0)
    pairs = len(loud) // 2
    says = f"{pairs} pair{'s are' if pairs != 1 else ' is'}" if pairs else "No two parameters are"
    dots = " (white dots)" if pairs else ""
    ax.set_title(f"{says} correlated by {LOUD:g} or more at the {basis.poses} chosen poses{dots}")
    says = "correlation of the fitted parameters"
    figure.colorbar(image, ax=ax, label=says, aspect=40)
