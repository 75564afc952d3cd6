"""Pictures of the study of places: what each number of circles knows, and where they are."""

import numpy as np

from planner.common.units import to_mm
from planner.report.chart import BLACK, GREY, JOINTS, RED, SKY, Chart, Panel, ReferenceLine, Series
from planner.report.formatting import significant_text
from planner.study.compliance_design.common_fit import CommonFit
from planner.study.compliance_design.place_selection import CirclePlaceChoice


def draw_places(found: CirclePlaceChoice, count: int) -> tuple[Chart, ...]:
    """Return every picture, the places of the best set of ``count`` marked."""
    return (draw_learning_curve(found), draw_centres(found, count))


def draw_learning_curve(found: CirclePlaceChoice) -> Chart:
    """Standard deviation of each compliance against the number of places."""
    x = np.arange(len(found.sets) + 1, dtype=float)
    rows = np.array([found.own.std, *(k.std for k in found.known)])
    series = [
        Series(n.replace("compliance", "c"), x, rows[:, k], JOINTS[k % len(JOINTS)]) for k, n in enumerate(found.names)
    ]
    low = 10.0 ** np.floor(np.log10(rows.min()))
    panel = Panel(
        "",
        "number of places, chosen together (0: the cell's own circle alone)",
        "standard deviation / prior size",
        tuple(series),
        limits=(ReferenceLine(1.0, "prior size", below=True),),
        log_y=True,
        y_range=(float(low), 1.3),
        height=330,
    )
    return Chart(
        "learnt", "What more places tell", "Predicted, with the loads and repeats of the cell's circle.", (panel,)
    )


def draw_centres(found: CirclePlaceChoice, count: int) -> Chart:
    """Centres of the circles, in the upright plane through axis 1, a panel for each plane of the circle."""
    chosen = {int(i): k + 1 for k, i in enumerate(found.sets[count - 1])}
    panels = []
    for plane in ("XY", "XZ", "YZ"):
        own = [i for i, c in enumerate(found.pool) if c.plane == plane]
        series = [_centre_points(found, own, GREY, 6.0, f"{plane}")]
        marked = [i for i in own if i in chosen]
        if marked:
            series.append(_centre_points(found, marked, RED, 11.0, "chosen", tuple(str(chosen[i]) for i in marked)))
        panels.append(
            Panel(
                f"circles in {plane}",
                "distance from axis 1 (mm)",
                "height (mm)",
                tuple(series),
                x_range=_axis_range(found, 0),
                y_range=_axis_range(found, 1),
                height=230,
            )
        )
    caption = (
        f"Grey: every circle that the arm can follow within limits and cones. Red: the {count} that know the "
        "compliances best together. Turning all of it about axis 1 changes nothing."
    )
    return Chart("where", "Where the circles are", caption, tuple(panels))


def _centre_points(
    found: CirclePlaceChoice, which: list[int], colour: str, size: float, name: str, texts: tuple[str, ...] = ()
) -> Series:
    at = np.array([_centre_in_plane(found, i) for i in which]).reshape(-1, 2)
    hover = tuple(f"{name} at {significant_text(float(x), 4)}, {significant_text(float(z), 4)} mm" for x, z in at)
    return Series(name, at[:, 0], at[:, 1], colour or BLACK, "points", hover=hover, texts=texts, size=size)


def _centre_in_plane(found: CirclePlaceChoice, i: int) -> tuple[float, float]:
    x, y, z = to_mm(found.pool[i].centre)
    return float(np.hypot(x, y)), float(z)


def _axis_range(found: CirclePlaceChoice, axis: int) -> tuple[float, float]:
    values = np.array([_centre_in_plane(found, i)[axis] for i in range(len(found.pool))])
    pad = 0.08 * float(np.ptp(values)) + 50.0
    return float(values.min()) - pad, float(values.max()) + pad


def draw_common_fit(known: CommonFit) -> Chart:
    """Standard deviation of every common parameter by the poses, by the circles, and by one fit of both."""
    place = np.arange(len(known.names), dtype=float)
    kinds = (
        ("without load", known.unloaded, GREY),
        ("loaded circles", known.loaded, SKY),
        ("one fit", known.both, RED),
    )
    series = tuple(
        Series(
            text, part, place, colour, "points", size=6.0 if text != "one fit" else 8.0,
            hover=tuple(
                f"{n}: {significant_text(float(v))} of its prior size" for n, v in zip(known.names, part, strict=True)
            ),
        )
        for text, part, colour in kinds
    )  # fmt: skip
    low = 10.0 ** np.floor(np.log10(known.both.min()))
    panel = Panel(
        "",
        "standard deviation / prior size",
        "",
        series,
        limits=(ReferenceLine(1.0, "prior size", upright=True),),
        log_x=True,
        x_range=(float(low), 2.0),
        y_names=known.names,
        height=22 * len(known.names) + 30,
    )
    caption = (
        "Predicted: by the poses without load, by the loaded circles, and by one fit of both runs. Parameters that "
        "stay near their prior size in all three cannot be told apart; others carry their error."
    )
    return Chart("known", "What each run knows, and both together", caption, (panel,))
