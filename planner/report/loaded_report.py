"""The report of a loaded double ball bar, with the charts of the EDBB paper's figures 13 to 15."""

from dataclasses import replace

import numpy as np

from planner.common.units import UM, URAD, Array, to_deg, to_mm
from planner.loaded.circle_candidates import CirclePlaceChoice
from planner.loaded.common_fit import CommonFit
from planner.loaded.joint_fit import JointFit
from planner.loaded.results import share_text
from planner.loaded.types import NOT_LEARNT, SENSES, EvaluatedCircle, LoadedEvaluation
from planner.report.calibration_text import estimate_unit
from planner.report.chart import (
    BLUE,
    GREEN,
    GREY,
    JOINTS,
    ORANGE,
    RED,
    SKY,
    Chart,
    Panel,
    ReferenceLine,
    Series,
    Span,
    list_panel,
    share_panel,
)
from planner.report.formatting import digits
from planner.report.page import Report

SHARE = "standard deviation / prior sigma"
FINEST_SHARE = 1e-6  # of the prior sigma: what is known better is drawn there


def loaded_charts(found: LoadedEvaluation) -> tuple[Chart, ...]:
    """Return every picture of the report."""
    out = []
    for k, c in enumerate(found.circles):
        several = len(found.circles) > 1
        number, where = (f"_{k + 1}", f", fixture {c.curves.circle.name}") if several else ("", "")
        for chart in (readings_chart(c), deflection_chart(c), compensated_chart(c), kinematic_chart(c)):
            out.append(replace(chart, name=f"{chart.name}{number}", title=f"{chart.title}{where}"))
    return (*out, compliance_chart(found))


def readings_chart(c: EvaluatedCircle) -> Chart:
    """Readings at every load (paper, figure 13 a)."""
    curves = c.curves
    raw = curves.length - curves.length.mean()
    panels = [
        _panel(SENSES[sense], "reading − mean (µm)", _lines(curves.theta, raw[d], _loads(c)))
        for d, sense in enumerate(curves.directions)
    ]
    caption = f"Average of {int(curves.repeats.min())} turns at each load, in each sense of travel."
    return Chart("readings", "Readings under load", caption, tuple(panels))


def deflection_chart(c: EvaluatedCircle) -> Chart:
    """Distance of the readings from those at the base load (paper, figure 13 b), and by the compliances."""
    curves, panels = c.curves, []
    texts = [f"{load:.0f} N more" for load in curves.loads_beyond_base]
    for d, sense in enumerate(curves.directions):
        lines = _lines(curves.theta, curves.deflection[d], texts, 1)
        lines += _lines(curves.theta, c.predicted[d], [""] * len(texts), 1, dashed=True)
        panels.append(_panel(SENSES[sense], "change of the reading (µm)", lines))
    caption = (
        f"Reading at a load less that at the base load of {curves.loads[0]:.0f} N, and dashed what the fitted "
        "compliances make of it."
    )
    return Chart("deflections", "Deflection along the bar", caption, tuple(panels))


def compensated_chart(c: EvaluatedCircle) -> Chart:
    """Readings without what the arm yields, and their average with the centre's offset (paper, figure 14)."""
    curves, angle = c.curves, to_deg(c.curves.theta)
    shown = c.compensated.mean(axis=0)
    lines = [
        Series("average", angle, c.averaged.mean(axis=0) / UM, BLUE),
        Series("offset of the centre", angle, c.offset.sine(curves.theta) / UM, RED, dashed=True),
    ]
    read = float(np.ptp(curves.length, axis=1).max())
    spread, read_spread, amplitude = (digits(v) for v in (c.spread / UM, read / UM, c.offset.amplitude * 1e3))
    caption = (
        f"The loads' curves lie up to {spread} µm apart (as read: {read_spread} µm). The circle's centre is off its "
        f"ball, which shows once a turn with {amplitude} mm."
    )
    apart = shown - shown.mean(axis=0)
    panels = (
        _panel("as without load", "reading − mean (µm)", _lines(curves.theta, shown - shown.mean(), _loads(c))),
        _panel("distance from their average", "distance (µm)", _lines(curves.theta, apart, _loads(c))),
        _panel("average", "reading − mean (µm)", lines),
    )
    return Chart("compensated", "Without the load", caption, panels)


def kinematic_chart(c: EvaluatedCircle) -> Chart:
    """Draw the error that is left without load and offset, beside the tracker's (paper, figure 15)."""
    angle = to_deg(c.curves.theta)
    series = [
        Series(SENSES[d], angle, y / UM, colour)
        for d, y, colour in zip(c.curves.directions, c.kinematic, (BLUE, ORANGE), strict=False)
    ]
    caption = "Reading without load and without the offset of the circle's centre: the arm's own error along the bar."
    if c.tracker is not None:
        series.append(Series("tracker", angle, c.tracker.tracker / UM, GREEN, dashed=True))
        mean, largest = (digits(v / UM) for v in (c.tracker.mean, c.tracker.largest))
        caption += f" The tracker's unloaded circle differs by {mean} µm on average, {largest} µm at most."
    return Chart("kinematic", "Kinematic error", caption, (_panel("", "error along the bar (µm)", series),))


def compliance_chart(found: LoadedEvaluation) -> Chart:
    """How well each compliance and each combination is known, as a part of its prior sigma."""
    c = found.compliances
    joints = [(n.replace("compliance", "c"), s / p) for n, s, p in zip(c.names, c.std, c.prior, strict=True)]
    mixed = [(k.text, k.std) for k in c.combinations]
    values = np.array([v for _, v in (*joints, *mixed)])
    span = (_decade(np.clip(values, FINEST_SHARE, 0.5)), float(10.0 ** np.ceil(np.log10(max(2.0, values.max())))))
    panels = (
        _shares("each by itself, with what was known before", joints, BLUE, span),
        _shares("combinations, by the circles alone", mixed, GREEN, span),
    )
    caption = (
        "Standard deviation as a part of the prior sigma: left of the dotted line a compliance is learnt, right of it "
        "nothing is. What a circle knows are combinations (by the readings alone); a joint takes the worst of its own."
    )
    return Chart("known", "What the circles know of the compliances", caption, panels)


def _shares(title: str, parts: list[tuple[str, float]], colour: str, span: Span) -> Panel:
    share = np.array([max(v, FINEST_SHARE) for _, v in parts])
    hover = [f"{n}: {digits(v)} of the prior sigma" for n, v in parts]
    return share_panel(title, SHARE, [n for n, _ in parts], share, hover, colour, span, 24)


def _panel(title: str, y_label: str, series: list[Series]) -> Panel:
    return Panel(title, "angle on the circle (degrees)", y_label, tuple(series), x_range=(0.0, 360.0), height=260)


def _loads(c: EvaluatedCircle) -> list[str]:
    return [f"{load:.0f} N" for load in c.curves.loads]


def _lines(theta: Array, values: Array, names: list[str], first: int = 0, dashed: bool = False) -> list[Series]:
    """One line a load, (K, B) [m]; unnamed ones stay out of the legend."""
    return [
        Series(n, to_deg(theta), v / UM, JOINTS[(first + k) % len(JOINTS)], dashed=dashed)
        for k, (n, v) in enumerate(zip(names, values, strict=True))
    ]


def report_loaded_run(found: LoadedEvaluation, joint: JointFit | None = None) -> Report:
    """Return the page of a loaded run and its pictures."""
    c = found.compliances
    rows = []
    for name, v, s, p, told in zip(c.names, c.value, c.std, c.prior, c.verdicts, strict=True):
        value = "–" if told == NOT_LEARNT else digits(v / URAD)
        rows.append((name, value, digits(s / URAD, 2), digits(p / URAD), share_text(s / p), told))
    content = {
        "found": found,
        "joint": joint,
        "compliances": rows,
        "combinations": [(k.text, share_text(k.std), k.verdict) for k in c.combinations],
        "together": [] if joint is None else _joint_fit_rows(joint),
    }
    return Report("loaded.html.j2", content, loaded_charts(found))


def _joint_fit_rows(joint: JointFit) -> list[tuple[str, ...]]:
    """Rows of the joint fit: name, unit, change, standard deviation; in the units of a calibration."""
    rows: list[tuple[str, ...]] = []
    for e in joint.estimates:
        if e.std is not None:
            unit, factor = estimate_unit(e)
            rows.append((e.name, unit, digits((e.value - e.nominal) * factor), digits(e.std * factor, 2)))
    return rows


def draw_places(found: CirclePlaceChoice, count: int) -> tuple[Chart, ...]:
    """Return every picture, the places of the best set of ``count`` marked."""
    return (draw_learning_curve(found), draw_centres(found, count))


def draw_learning_curve(found: CirclePlaceChoice) -> Chart:
    """Standard deviation of each compliance against the number of places."""
    x = np.arange(len(found.sets) + 1, dtype=float)
    rows = np.array([found.own.std, *(k.std for k in found.known)])
    names = [n.replace("compliance", "c") for n in found.names]
    series = tuple(Series(n, x, rows[:, k], JOINTS[k % len(JOINTS)]) for k, n in enumerate(names))
    label = "number of places, chosen together (0: the cell's own circle alone)"
    prior = (ReferenceLine(1.0, "prior sigma", below=True),)
    panel = Panel("", label, SHARE, series, prior, log_y=True, y_range=(_decade(rows), 1.3), height=330)
    caption = "Predicted, with the loads and repeats of the cell's circle."
    return Chart("learnt", "What more places tell", caption, (panel,))


def _decade(values: Array) -> float:
    """The power of ten below all values."""
    return float(10.0 ** np.floor(np.log10(values.min())))


def draw_centres(found: CirclePlaceChoice, count: int) -> Chart:
    """Centres of the circles, in the upright plane through axis 1, a panel for each plane of the circle."""
    chosen = set(found.sets[count - 1].tolist())
    centre = np.array([to_mm(c.circle.p_BC) for c in found.pool])
    at = np.stack([np.hypot(centre[:, 0], centre[:, 1]), centre[:, 2]], axis=1)
    pad = 0.08 * np.ptp(at, axis=0) + 50.0
    x_range, y_range = zip((at.min(axis=0) - pad).tolist(), (at.max(axis=0) + pad).tolist(), strict=True)
    labels = ("distance from axis 1 (mm)", "height (mm)")
    panels = []
    for plane in ("XY", "XZ", "YZ"):
        own = [i for i, c in enumerate(found.pool) if c.circle.plane == plane]
        series = [_centre_points(at[own], GREY, 6.0, plane)]
        if marked := [i for i in own if i in chosen]:
            series.append(_centre_points(at[marked], RED, 11.0, "chosen"))
        title = f"circles in {plane}"
        panels.append(Panel(title, *labels, tuple(series), x_range=x_range, y_range=y_range, height=230))
    caption = (
        f"Grey: every circle that the arm can follow within limits and cones. Coloured: the {count} that know the "
        "compliances best together. Turning all of it about axis 1 changes nothing."
    )
    return Chart("where", "Where the circles are", caption, tuple(panels))


def _centre_points(at: Array, colour: str, size: float, name: str) -> Series:
    hover = tuple(f"{name} at {digits(x, 4)}, {digits(z, 4)} mm" for x, z in at.tolist())
    return Series(name, at[:, 0], at[:, 1], colour, "points", hover=hover, size=size)


def draw_common_fit(known: CommonFit) -> Chart:
    """Standard deviation of every common parameter by the poses, by the circles, and by one fit of both."""
    place = np.arange(len(known.names), dtype=float)
    looks = (("without load", GREY, 6.0), ("loaded circles", SKY, 6.0), ("one fit", RED, 8.0))
    series = []
    for (text, colour, size), part in zip(looks, known.parts.values(), strict=True):
        hover = tuple(f"{n}: {digits(v)} of its prior sigma" for n, v in zip(known.names, part.tolist(), strict=True))
        series.append(Series(text, part, place, colour, "points", size=size, hover=hover))
    prior, reach = (ReferenceLine(1.0, "prior sigma", upright=True),), (_decade(known.both), 2.0)
    panel = list_panel("", SHARE, known.names, series, 22, 30, limits=prior, log_x=True, x_range=reach)
    caption = (
        "Predicted: by the poses without load, by the loaded circles, and by one fit of both runs. Parameters that "
        "stay near their prior sigma in all three cannot be told apart; others carry their error."
    )
    return Chart("known", "What each run knows, and both together", caption, (panel,))
