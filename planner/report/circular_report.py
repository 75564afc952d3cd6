"""The report of a measured circular test: polar plots, the figures of ISO 230-4, steps at reversals."""

import math

import numpy as np

from planner.common.units import UM, to_deg, to_mm
from planner.instruments.circular.evaluation import CircularTest
from planner.instruments.circular.figures import CircleFigures, PathFigures
from planner.report.chart import BASE, BLUE, GREY, RED, Chart, Panel, ReferenceLine, Series
from planner.report.formatting import in_um
from planner.report.page import Report, Row

POINTS = 1440  # of a path at most: a picture has no more
COLOURS = {"ccw": BLUE, "cw": RED}
ROUND = (1.0, 2.0, 2.5, 5.0, 10.0)


def report_circular_test(test: CircularTest) -> Report:
    """Return the page of a measured circular test and its pictures."""
    polar = [polar_chart(c, k) for k, c in enumerate(test.circles)]
    radial = [radial_chart(c, k) for k, c in enumerate(test.circles)]
    content = {
        "test": test,
        "facts": [_facts(c) for c in test.circles],
        "circles": [
            {
                "name": _name(c),
                "plane": c.ring.circle.plane,
                "polar": polar[k],
                "chart": radial[k],
                "figures": [_figures(p) for p in c.paths],
                "together": _together(c),
                "reversals": [row for p in c.paths for row in _reversals(p)],
            }
            for k, c in enumerate(test.circles)
        ],
    }
    return Report("circular.html.j2", content, (*polar, *radial))


def division(circle: CircleFigures) -> float:
    """Micrometres from one ring of the plot to the next: a round number, three of them hold all deviations."""
    largest = max(max(p.F_max - circle.D, circle.D - p.F_min) for p in circle.paths) / UM
    rough = max(largest / 3.0, 1e-3)
    ten = 10.0 ** np.floor(np.log10(rough))
    return float(ten * next(r for r in ROUND if r * ten >= rough))


def path_series(circle: CircleFigures) -> tuple[Series, ...]:
    """Radial deviation [µm] from the least-squares circle of all paths over the angle [deg], thinned to a picture."""
    out = []
    for path in circle.paths:
        order = np.argsort(path.angle, kind="stable")
        parts = np.array_split(order, min(POINTS, len(order)))
        angle = to_deg(np.array([path.angle[p].mean() for p in parts]))
        radial = (np.array([path.radial[p].mean() for p in parts]) - circle.D) / UM
        hover = tuple(f"{a:.1f}°: {r:+.1f} µm {path.direction}" for a, r in zip(angle, radial, strict=True))
        out.append(Series(path.direction, angle, radial, COLOURS[path.direction], width=1.4, hover=hover))
    return tuple(out)


def polar_chart(c: CircleFigures, number: int) -> Chart:
    """The plot that ball-bar users know: the path about its circle, with the deviations magnified."""
    ring, around = division(c), np.linspace(0.0, 360.0, 361)
    circle = Series("least-squares circle", around, 0 * around, GREY, dashed=True, width=1.0)
    times = c.ring.circle.radius / (BASE * ring * UM)
    return Chart(
        f"polar_{number + 1}",
        f"Circle {_name(c)}",
        f"Deviations drawn {times:.0f} times larger than the circle, {ring:g} µm a division; from the least-squares "
        "circle of both directions; outwards is a longer bar.",
        (
            Panel(
                f"Circle {_name(c)}: {ring:g} µm a division",
                "",
                "µm",
                (*path_series(c), circle),
                height=620,
                rings=ring,
            ),
        ),
    )


def radial_chart(c: CircleFigures, number: int) -> Chart:
    """Radial deviation over the angle, with the reversals of the axes."""
    reversals = {round(float(to_deg(r.angle)), 1): r.joints for p in c.paths[:1] for r in p.reversals}
    lines = [ReferenceLine(a, f"axis {', '.join(str(j + 1) for j in js)}", upright=True) for a, js in reversals.items()]
    span = (float(to_deg(c.ring.circle.start)), float(to_deg(c.ring.circle.start + c.ring.circle.sweep)))
    labels = ("", "angle on the circle (deg)", "radial deviation (µm)")
    return Chart(
        f"radial_{number + 1}",
        f"Circle {_name(c)}: radial deviation over the angle",
        "From the least-squares circle of both directions. Dotted: where an axis of the robot reverses.",
        (Panel(*labels, path_series(c), limits=tuple(lines), x_range=span, height=300),),
    )


def _facts(c: CircleFigures) -> Row:
    """What a person asks for first."""
    if c.G_b is not None:
        return (f"circle {_name(c)}", f"{in_um(c.G_b)} µm", "G(b), both directions between two circles")
    path = c.paths[0]
    return (f"circle {_name(c)}", f"{in_um(path.G)} µm", f"G({path.direction}), between two circles")


def _figures(p: PathFigures) -> Row:
    values = (p.G, p.G_ls, p.F_max, p.F_min, p.mean, *p.offset)
    return (p.direction, *(in_um(v) for v in values), str(p.sweeps))


def _together(c: CircleFigures) -> tuple[Row, ...]:
    first, second = c.ring.circle.plane[0], c.ring.circle.plane[1]
    rows = [
        (
            "centre, by least squares, taken off",
            (
                f"{first} {in_um(c.centre.centre[0])} ± {in_um(c.centre.std[0])} µm, {second}"
                f" {in_um(c.centre.centre[1])} ± {in_um(c.centre.std[1])} µm from the planned one"
            ),
        ),
        ("mean radial deviation D", f"{in_um(c.D)} µm"),
    ]
    if c.G_b is not None:
        rows += [
            (
                "bidirectional circular deviation G(b)",
                f"{in_um(c.G_b)} µm; about the least-squares centre {in_um(c.G_b_ls)} µm",
            ),
            ("hysteresis H, ccw less cw", f"{in_um(c.H)} µm at most, {in_um(c.H_mean)} µm on average"),
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
            "–" if math.isnan(r.step) else f"{in_um(r.step)} ± {in_um(r.std)}",
        )
        for r in p.reversals
    ]


def _name(c: CircleFigures) -> str:
    return c.ring.circle.name if c.load is None else f"{c.ring.circle.name}, {c.load:g} N"
