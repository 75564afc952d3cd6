"""The report of a loaded double ball bar, with the charts of the EDBB paper's figures 13 to 15."""

import numpy as np

from planner.common.units import UM, Array, to_deg
from planner.instruments.loaded.circle import sine
from planner.instruments.loaded.joint_fit import JointFit
from planner.instruments.loaded.results import SENSES, share_text
from planner.instruments.loaded.types import NOT_LEARNT, EvaluatedCircle, LoadedEvaluation
from planner.report.chart import BLUE, GREEN, GREY, JOINTS, ORANGE, RED, Chart, Panel, ReferenceLine, Series
from planner.report.formatting import significant_text
from planner.report.page import Report

ANGLE = "angle on the circle (degrees)"
TURN = (0.0, 360.0)
ROW = 24  # [px] of one name in a list
FINEST = 1e-6  # of the prior size: what is known better is drawn there


def loaded_charts(found: LoadedEvaluation) -> tuple[Chart, ...]:
    """Return every picture of the report."""
    each = [p for k, c in enumerate(found.circles) for p in _of_circle(c, k, len(found.circles) > 1)]
    return (*each, compliance_chart(found))


def _of_circle(c: EvaluatedCircle, k: int, several: bool) -> tuple[Chart, ...]:
    stem = f"_{k + 1}" if several else ""
    where = f", fixture {c.curves.circle.name}" if several else ""
    return tuple(
        draw(c, stem, where) for draw in (readings_chart, deflection_chart, compensated_chart, kinematic_chart)
    )


def readings_chart(c: EvaluatedCircle, stem: str = "", where: str = "") -> Chart:
    """Readings at every load (paper, figure 13 a)."""
    curves = c.curves
    raw = curves.length - curves.length.mean()
    texts = [f"{load:.0f} N" for load in curves.loads]
    panels = tuple(
        _panel(SENSES[sense], "reading − mean (µm)", _lines(curves.theta, raw[d], texts))
        for d, sense in enumerate(curves.directions)
    )
    caption = f"Average of {int(curves.repeats.min())} turns at each load, in each sense of travel."
    return Chart(f"readings{stem}", f"Readings under load{where}", caption, panels)


def deflection_chart(c: EvaluatedCircle, stem: str = "", where: str = "") -> Chart:
    """Distance of the readings from those at the base load (paper, figure 13 b), and by the compliances."""
    curves = c.curves
    texts = [f"{load:.0f} N more" for load in curves.apparent]
    panels = tuple(
        _panel(
            SENSES[sense],
            "change of the reading (µm)",
            [
                *_lines(curves.theta, curves.deflection[d], texts, 1),
                *_lines(curves.theta, c.predicted[d], [""] * len(texts), 1, dashed=True),
            ],
        )
        for d, sense in enumerate(curves.directions)
    )
    caption = (
        f"Reading at a load less that at the base load of {curves.loads[0]:.0f} N, and dashed what the fitted "
        "compliances make of it."
    )
    return Chart(f"deflections{stem}", f"Deflection along the bar{where}", caption, panels)


def compensated_chart(c: EvaluatedCircle, stem: str = "", where: str = "") -> Chart:
    """Readings without what the arm yields, and their average with the centre's offset (paper, figure 14)."""
    curves, angle = c.curves, to_deg(c.curves.theta)
    shown = c.compensated.mean(axis=0)
    texts = [f"{load:.0f} N" for load in curves.loads]
    lines = [
        Series("average", angle, c.averaged.mean(axis=0) / UM, BLUE),
        Series("offset of the centre", angle, sine(c.offset, curves.theta) / UM, RED, dashed=True),
    ]
    free = ""
    if c.paper_offset is not None:
        lines.append(Series("with b free", angle, sine(c.paper_offset, curves.theta) / UM, GREY, dashed=True))
        free = (
            f" (b free as in the paper: {significant_text(c.paper_offset.amplitude * 1e3)} mm, "
            f"b = {significant_text(c.paper_offset.frequency)})"
        )
    panels = (
        _panel("as without load", "reading − mean (µm)", _lines(curves.theta, shown - shown.mean(), texts)),
        _panel("distance from their average", "distance (µm)", _lines(curves.theta, shown - shown.mean(axis=0), texts)),
        _panel("average", "reading − mean (µm)", lines),
    )
    caption = (
        f"The loads' curves lie up to {significant_text(c.spread / UM)} µm apart (as read:"
        f" {significant_text(float(np.ptp(curves.length, axis=1).max()) / UM)} µm). The circle's centre is off its"
        f" ball, which shows once a turn with {significant_text(c.offset.amplitude * 1e3)} mm{free}."
    )
    return Chart(f"compensated{stem}", f"Without the load{where}", caption, panels)


def kinematic_chart(c: EvaluatedCircle, stem: str = "", where: str = "") -> Chart:
    """What is left when load and offset are taken off, beside the tracker's (paper, figure 15)."""
    angle = to_deg(c.curves.theta)
    series = [
        Series(SENSES[d], angle, y / UM, colour)
        for d, y, colour in zip(c.curves.directions, c.kinematic, (BLUE, ORANGE), strict=False)
    ]
    caption = "Reading without load and without the offset of the circle's centre: the arm's own error along the bar."
    if c.tracker is not None:
        series.append(Series("tracker", angle, c.tracker.tracker / UM, GREEN, dashed=True))
        caption += (
            f" The tracker's unloaded circle differs by {significant_text(c.tracker.mean / UM)} µm on average, "
            f"{significant_text(c.tracker.largest / UM)} µm at most."
        )
    panel = _panel("", "error along the bar (µm)", series)
    return Chart(f"kinematic{stem}", f"Kinematic error{where}", caption, (panel,))


def compliance_chart(found: LoadedEvaluation) -> Chart:
    """How well each compliance and each combination is known, as a part of its prior size."""
    c = found.compliances
    joints = [(n.replace("compliance", "c"), s / p) for n, s, p in zip(c.names, c.std, c.prior, strict=True)]
    mixed = [(k.text, k.std) for k in c.combinations]
    values = np.array([v for _, v in (*joints, *mixed)])
    low = 10.0 ** np.floor(np.log10(min(max(values.min(), FINEST), 0.5)))
    span = (float(low), float(10.0 ** np.ceil(np.log10(max(2.0, values.max())))))
    panels = (
        _parts("each by itself, with what was known before", joints, BLUE, span),
        _parts("combinations, by the circles alone", mixed, GREEN, span),
    )
    caption = (
        "Standard deviation as a part of the prior size: left of the dotted line a compliance is learnt, right of it "
        "nothing is. What a circle knows are combinations (by the readings alone); a joint takes the worst of its own."
    )
    return Chart("known", "What the circles know of the compliances", caption, panels)


def _parts(title: str, rows: list[tuple[str, float]], colour: str, span: tuple[float, float]) -> Panel:
    share = np.array([max(v, FINEST) for _, v in rows])
    place = np.arange(len(rows), dtype=float)
    hover = tuple(f"{n}: {significant_text(v)} of the prior size" for n, v in rows)
    return Panel(
        title,
        "standard deviation / prior size",
        "",
        (Series("", share, place, colour, "points", hover=hover),),
        limits=(ReferenceLine(1.0, "prior size", upright=True),),
        log_x=True,
        x_range=span,
        y_names=tuple(n for n, _ in rows),
        height=ROW * len(rows) + 30,
    )


def _panel(title: str, y_label: str, series: list[Series]) -> Panel:
    return Panel(title, ANGLE, y_label, tuple(series), x_range=TURN, height=260)


def _lines(theta: Array, values: Array, names: list[str], first: int = 0, dashed: bool = False) -> list[Series]:
    """One line a load, (K, B) [m]; unnamed ones stay out of the legend."""
    return [
        Series(n, to_deg(theta), v / UM, JOINTS[(first + k) % len(JOINTS)], dashed=dashed)
        for k, (n, v) in enumerate(zip(names, values, strict=True))
    ]


URAD = 1e-6


def report_loaded(found: LoadedEvaluation, joint: JointFit | None = None) -> Report:
    """Return the page of a loaded run and its pictures."""
    c = found.compliances
    rows = [
        (
            name,
            "–" if told == NOT_LEARNT else significant_text(v / URAD),
            significant_text(s / URAD, 2),
            significant_text(p / URAD),
            share_text(s / p),
            told,
        )
        for name, v, s, p, told in zip(c.names, c.value, c.std, c.prior, c.told, strict=True)
    ]
    content = {
        "found": found,
        "joint": joint,
        "compliances": rows,
        "combinations": [(k.text, share_text(k.std), k.told) for k in c.combinations],
        "together": [] if joint is None else _together(joint),
    }
    return Report("loaded.html.j2", content, loaded_charts(found))


def _together(joint: JointFit) -> list[tuple[str, ...]]:
    """Rows of the joint fit: name, unit, change, standard deviation; lengths in mm, angles in mrad."""
    units = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "rad/Nm": ("µrad/Nm", 1e6)}
    rows: list[tuple[str, ...]] = []
    for e in joint.estimates:
        if e.std is not None:
            unit, factor = units.get(e.unit, (e.unit, 1.0))
            rows.append(
                (e.name, unit, significant_text((e.value - e.nominal) * factor), significant_text(e.std * factor, 2))
            )
    return rows
