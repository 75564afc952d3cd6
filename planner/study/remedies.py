"""The study's picture of more fixtures, and of what else shows the parameters that stay unseen."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from planner.report.picture import BLUE, GREY, RED
from planner.report.printed import png, style
from planner.study.fixtures import Fixtures
from planner.study.summary import number

PALE = "#A6CEE3"


def fixtures_png(fixtures: Fixtures, index: str) -> bytes:
    """What each number of fixtures sees, and which remedy shows each parameter that stays unseen."""
    unseen = [d.name for d in fixtures.steps[0].dropped]
    with style():
        figure = Figure(figsize=(11.5, max(3.8, 2.4 + 0.28 * len(unseen))), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=[1, 1.7])
        _steps(left, fixtures, index)
        _matrix(right, fixtures, unseen)
        return png(figure)


def _steps(ax: Axes, fixtures: Fixtures, index: str) -> None:
    steps = fixtures.steps
    at, robot, seen = ([getattr(s, key) for s in steps] for key in ("fixtures", "robot_seen", "seen"))
    gauge = [s.seen - s.robot_seen for s in steps]
    lost = [s.parameters - s.seen for s in steps]
    ax.bar(at, robot, width=0.6, color=BLUE, label="the robot's own")
    if any(gauge):
        ax.bar(at, gauge, bottom=robot, width=0.6, color=PALE, label="fixtures, tool, zero")
    ax.bar(at, lost, bottom=seen, width=0.6, color="none", edgecolor=GREY, hatch="////", label="not seen")
    for s in steps:
        ax.text(s.fixtures, s.parameters + 0.5, f"{index} {number(s.value)}", ha="center", va="bottom", fontsize=8.5)
        ax.annotate(str(s.robot_seen), (s.fixtures, s.robot_seen / 2), ha="center", va="center", color="white")
    ax.set_xticks(at)
    ax.set_ylim(0, 1.35 * max(s.parameters for s in steps))
    ax.set(xlabel=f"number of fixtures (above the bars: {index} of the robot's own)", ylabel="parameters")
    ax.set_title(_finding(fixtures, index))
    ax.legend(loc="upper left", ncols=2, fontsize=8.5)


def _finding(fixtures: Fixtures, index: str) -> str:
    steps = fixtures.steps
    if fixtures.needed > 1:
        return f"{fixtures.needed} fixtures see all that fixtures can show"
    if len(steps) == 1:
        return "One fixture, and no place for another"
    values = f"{index} goes from {number(steps[0].value)} to {number(steps[1].value)}"
    return f"A second fixture shows no more parameters;\n{values}"


def _matrix(ax: Axes, fixtures: Fixtures, unseen: list[str]) -> None:
    columns = _columns(fixtures)
    never = {d.name for d in fixtures.never}
    for y, name in enumerate(unseen):
        for x, (_, shown) in enumerate(columns):
            mark, colour, size = ("o", BLUE, 9) if name in shown else ("x", "#B5B5B5", 5)
            ax.plot(x, y, mark, color=colour, markersize=size)
        if name in never:
            ax.axhspan(y - 0.45, y + 0.45, color=RED, alpha=0.12, linewidth=0)
            ax.text(len(columns) - 0.46, y, "never", va="center", color=RED)
    ax.set_xticks(range(len(columns)), [_wrapped(head) for head, _ in columns], fontsize=8.5)
    ax.set_yticks(range(len(unseen)), unseen)
    ax.set_xlim(-0.5, max(len(columns), 1) - 0.5)
    ax.set_ylim(max(len(unseen), 1) - 0.5, -0.5)
    ax.spines[:].set_visible(False)
    ax.tick_params(length=0)
    hope = len(unseen) - len(never)
    says = f"{hope} of the {len(unseen)} unseen parameters can be shown in some way (dots)"
    ax.set_title(says if unseen else "Nothing stays unseen")


def _columns(fixtures: Fixtures) -> list[tuple[str, set[str]]]:
    """Heads, and the parameters that each shows."""
    out, shown = [], set[str]()
    for step in fixtures.steps[1:]:
        shown = shown | set(step.becomes)
        out.append((f"{step.fixtures} fixtures", shown))
    return out + [(r.name, set(r.shows)) for r in fixtures.remedies]


def _wrapped(text: str) -> str:
    """Break a column's head over short lines."""
    lines = [""]
    for word in text.split():
        if len(lines[-1]) + len(word) > 12:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "\n".join(lines).strip()
