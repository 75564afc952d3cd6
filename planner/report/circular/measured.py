"""The page of a measured circular test: polar plots, the figures of ISO 230-4, what happens at reversals."""

import math
from pathlib import Path

from plotly.offline import get_plotlyjs

from planner.circular.evaluation import CircularTest
from planner.circular.figures import CircleFigures, PathFigures
from planner.files import write_bytes, write_text
from planner.report.circular.polar import COLOURS, division, magnification, polar_json, polar_paths, polar_png
from planner.report.picture import Limit, Panel, Picture, Series
from planner.report.printed import picture_png
from planner.report.template import embedded, template
from planner.report.web import figure_json
from planner.units import UM, to_deg, to_mm

Row = tuple[str, ...]


def write_test_report(test: CircularTest, folder: Path) -> list[Path]:
    """Write ``report.html`` into an existing folder, and its pictures as PNGs into ``folder/pictures``.

    The same test gives the same bytes.

    Returns:
        What was written, the page first.

    Raises:
        InputError: the folder does not exist, or may not be written.
    """
    charts = [_chart(c, k) for k, c in enumerate(test.circles)]
    names = [f"polar_{k + 1}" for k in range(len(test.circles))]
    figures = [(n, embedded(polar_json(c))) for n, c in zip(names, test.circles, strict=True)]
    figures += [(p.name, embedded(figure_json(p))) for p in charts]
    page = template("circular/measured.html.j2").render(
        test=test,
        facts=[_facts(c) for c in test.circles],
        circles=[_circle(c, n, chart) for c, n, chart in zip(test.circles, names, charts, strict=True)],
        figures=figures,
        plotly=get_plotlyjs(),
    )
    write_text(folder / "report.html", page)
    (folder / "pictures").mkdir(exist_ok=True)
    prints = [(n, polar_png(c)) for n, c in zip(names, test.circles, strict=True)]
    prints += [(p.name, picture_png(p)) for p in charts]
    paths = [folder / "pictures" / f"{name}.png" for name, _ in prints]
    for path, (_, data) in zip(paths, prints, strict=True):
        write_bytes(path, data)
    return [folder / "report.html", *paths]


def _facts(c: CircleFigures) -> Row:
    """What a person asks for first."""
    if c.G_b is not None:
        return (_name(c), f"{um(c.G_b)} µm", "G(b), both directions between two circles")
    path = c.paths[0]
    return (_name(c), f"{um(path.G)} µm", f"G({path.direction}), between two circles")


def _circle(c: CircleFigures, polar: str, chart: Picture) -> dict[str, object]:
    return {
        "name": _name(c),
        "plane": c.ring.plane,
        "polar": polar,
        "chart": chart,
        "division": f"{division(c):g}",
        "magnification": f"{magnification(c):.0f}",
        "figures": tuple(_figures(p) for p in c.paths),
        "together": _together(c),
        "reversals": tuple(row for p in c.paths for row in _reversals(p)),
    }


def _figures(p: PathFigures) -> Row:
    values = (p.G, p.G_ls, p.F_max, p.F_min, p.mean, *p.offset)
    return (p.direction, *(um(v) for v in values), str(p.sweeps))


def _together(c: CircleFigures) -> tuple[Row, ...]:
    first, second = c.ring.plane[0], c.ring.plane[1]
    rows = [
        (
            "centre, by least squares, taken off",
            f"{first} {um(c.centre.centre[0])} ± {um(c.centre.std[0])} µm, {second} {um(c.centre.centre[1])} ± "
            f"{um(c.centre.std[1])} µm from the planned one",
        ),
        ("mean radial deviation D", f"{um(c.D)} µm"),
    ]
    if c.G_b is not None:
        rows += [
            (
                "bidirectional circular deviation G(b)",
                f"{um(c.G_b)} µm; about the least-squares centre {um(c.G_b_ls)} µm",
            ),
            ("hysteresis H, ccw less cw", f"{um(c.H)} µm at most, {um(c.H_mean)} µm on average"),
        ]
    return (
        *rows,
        ("range of the bar that is used", f"{to_mm(c.length_range):.4f} mm"),
        ("range of readings less the length at the joint angles read", f"{to_mm(c.calculated_range):.4f} mm"),
    )


def _reversals(p: PathFigures) -> list[Row]:
    return [
        (
            p.direction,
            f"{to_deg(r.angle):.1f}",
            ", ".join(str(j + 1) for j in r.joints),
            "–" if math.isnan(r.step) else f"{um(r.step)} ± {um(r.std)}",
        )
        for r in p.reversals
    ]


def _chart(c: CircleFigures, number: int) -> Picture:
    paths = polar_paths(c)
    series = tuple(Series(p.direction, p.angle, p.radial, COLOURS[p.direction], width=1.2) for p in paths)
    marks = {round(float(to_deg(r.angle)), 1): r.joints for p in c.paths[:1] for r in p.reversals}
    limits = tuple(Limit(a, "axis " + ", ".join(str(j + 1) for j in js), upright=True) for a, js in marks.items())
    start, end = float(to_deg(c.ring.start)), float(to_deg(c.ring.start + c.ring.sweep))
    panel = Panel(
        "",
        "angle on the circle (deg)",
        "radial deviation (µm)",
        series,
        limits=limits,
        x_range=(start, end),
        height=300,
    )
    return Picture(
        f"radial_{number + 1}",
        f"Circle {_name(c)}: radial deviation over the angle",
        "From the least-squares circle of both directions. Dotted: where an axis of the robot reverses.",
        (panel,),
    )


def _name(c: CircleFigures) -> str:
    return c.ring.name if c.load is None else f"{c.ring.name}, {c.load:g} N"


def um(value: float | None) -> str:
    """Write a length [m] in micrometres."""
    return "–" if value is None else f"{float(value) / UM:.1f}"
