"""Pictures of loaded circles as the EDBB paper's figures 13 to 15, and of what the compliances are worth."""

import numpy as np

from planner.loaded import Evaluated, Loaded
from planner.loaded.centring import sine
from planner.loaded.results import SENSES
from planner.report.picture import BLUE, GREEN, GREY, JOINTS, ORANGE, RED, Limit, Panel, Picture, Series
from planner.report.words import sized
from planner.units import UM, Array, to_deg

ANGLE = "angle on the circle (degrees)"
TURN = (0.0, 360.0)
ROW = 24  # [px] of one name in a list
FINEST = 1e-6  # of the prior size: what is known better is drawn there


def pictures(found: Loaded) -> tuple[Picture, ...]:
    """Return every picture of the report."""
    each = [p for k, c in enumerate(found.circles) for p in _of_circle(c, k, len(found.circles) > 1)]
    return (*each, known(found))


def _of_circle(c: Evaluated, k: int, several: bool) -> tuple[Picture, ...]:
    stem = f"_{k + 1}" if several else ""
    where = f", fixture {c.curves.circle.name}" if several else ""
    return tuple(draw(c, stem, where) for draw in (readings, deflections, compensated, kinematic))


def readings(c: Evaluated, stem: str = "", where: str = "") -> Picture:
    """Readings at every load (paper, figure 13 a)."""
    curves = c.curves
    raw = curves.length - curves.length.mean()
    texts = [f"{load:.0f} N" for load in curves.loads]
    panels = tuple(
        _panel(SENSES[sense], "reading − mean (µm)", _lines(curves.theta, raw[d], texts))
        for d, sense in enumerate(curves.directions)
    )
    caption = f"Average of {int(curves.repeats.min())} turns at each load, in each sense of travel."
    return Picture(f"readings{stem}", f"Readings under load{where}", caption, panels)


def deflections(c: Evaluated, stem: str = "", where: str = "") -> Picture:
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
    return Picture(f"deflections{stem}", f"Deflection along the bar{where}", caption, panels)


def compensated(c: Evaluated, stem: str = "", where: str = "") -> Picture:
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
            f" (b free as in the paper: {sized(c.paper_offset.amplitude * 1e3)} mm, "
            f"b = {sized(c.paper_offset.frequency)})"
        )
    panels = (
        _panel("as without load", "reading − mean (µm)", _lines(curves.theta, shown - shown.mean(), texts)),
        _panel("distance from their average", "distance (µm)", _lines(curves.theta, shown - shown.mean(axis=0), texts)),
        _panel("average", "reading − mean (µm)", lines),
    )
    caption = (
        f"The loads' curves lie up to {sized(c.spread / UM)} µm apart (as read: "
        f"{sized(float(np.ptp(curves.length, axis=1).max()) / UM)} µm). The circle's centre is off its ball, which "
        f"shows once a turn with {sized(c.offset.amplitude * 1e3)} mm{free}."
    )
    return Picture(f"compensated{stem}", f"Without the load{where}", caption, panels)


def kinematic(c: Evaluated, stem: str = "", where: str = "") -> Picture:
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
            f" The tracker's unloaded circle differs by {sized(c.tracker.mean / UM)} µm on average, "
            f"{sized(c.tracker.largest / UM)} µm at most."
        )
    panel = _panel("", "error along the bar (µm)", series)
    return Picture(f"kinematic{stem}", f"Kinematic error{where}", caption, (panel,))


def known(found: Loaded) -> Picture:
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
    return Picture("known", "What the circles know of the compliances", caption, panels)


def _parts(title: str, rows: list[tuple[str, float]], colour: str, span: tuple[float, float]) -> Panel:
    share = np.array([max(v, FINEST) for _, v in rows])
    place = np.arange(len(rows), dtype=float)
    hover = tuple(f"{n}: {sized(v)} of the prior size" for n, v in rows)
    return Panel(
        title,
        "standard deviation / prior size",
        "",
        (Series("", share, place, colour, "points", hover=hover),),
        limits=(Limit(1.0, "prior size", upright=True),),
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
