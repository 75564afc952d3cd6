"""Pictures of the study of places: what each number of circles knows, and where they are."""

import numpy as np

from planner.common.units import Array, to_mm
from planner.instruments.loaded.common_fit import CommonFit
from planner.instruments.loaded.place_selection import CirclePlaceChoice
from planner.report.chart import GREY, JOINTS, RED, SKY, Chart, Panel, ReferenceLine, Series
from planner.report.formatting import digits

SHARE = "standard deviation / prior size"


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
    prior = ReferenceLine(1.0, "prior size", below=True)
    reach = (_decade(rows), 1.3)
    panel = Panel("", label, SHARE, series, limits=(prior,), log_y=True, y_range=reach, height=330)
    caption = "Predicted, with the loads and repeats of the cell's circle."
    return Chart("learnt", "What more places tell", caption, (panel,))


def _decade(values: Array) -> float:
    """The power of ten below all values."""
    return float(10.0 ** np.floor(np.log10(values.min())))


def draw_centres(found: CirclePlaceChoice, count: int) -> Chart:
    """Centres of the circles, in the upright plane through axis 1, a panel for each plane of the circle."""
    chosen = {int(i): str(k + 1) for k, i in enumerate(found.sets[count - 1])}
    centre = np.array([to_mm(c.circle.p_BC) for c in found.pool])
    at = np.stack([np.hypot(centre[:, 0], centre[:, 1]), centre[:, 2]], axis=1)
    pad = 0.08 * np.ptp(at, axis=0) + 50.0
    (left, low), (right, high) = (at.min(axis=0) - pad).tolist(), (at.max(axis=0) + pad).tolist()
    labels, x_range, y_range = ("distance from axis 1 (mm)", "height (mm)"), (left, right), (low, high)
    panels = []
    for plane in ("XY", "XZ", "YZ"):
        own = [i for i, c in enumerate(found.pool) if c.circle.plane == plane]
        series = [_centre_points(at[own], GREY, 6.0, plane)]
        marked = [i for i in own if i in chosen]
        if marked:
            series.append(_centre_points(at[marked], RED, 11.0, "chosen", tuple(chosen[i] for i in marked)))
        title = f"circles in {plane}"
        panels.append(Panel(title, *labels, tuple(series), x_range=x_range, y_range=y_range, height=230))
    caption = (
        f"Grey: every circle that the arm can follow within limits and cones. Red: the {count} that know the "
        "compliances best together. Turning all of it about axis 1 changes nothing."
    )
    return Chart("where", "Where the circles are", caption, tuple(panels))


def _centre_points(at: Array, colour: str, size: float, name: str, texts: tuple[str, ...] = ()) -> Series:
    hover = tuple(f"{name} at {digits(x, 4)}, {digits(z, 4)} mm" for x, z in at.tolist())
    return Series(name, at[:, 0], at[:, 1], colour, "points", hover=hover, texts=texts, size=size)


def draw_common_fit(known: CommonFit) -> Chart:
    """Standard deviation of every common parameter by the poses, by the circles, and by one fit of both."""
    place = np.arange(len(known.names), dtype=float)
    looks = (("without load", GREY, 6.0), ("loaded circles", SKY, 6.0), ("one fit", RED, 8.0))
    series = []
    for (text, colour, size), part in zip(looks, known.parts.values(), strict=True):
        told = zip(known.names, part.tolist(), strict=True)
        hover = tuple(f"{n}: {digits(v)} of its prior size" for n, v in told)
        series.append(Series(text, part, place, colour, "points", size=size, hover=hover))
    prior, reach = ReferenceLine(1.0, "prior size", upright=True), (_decade(known.both), 2.0)
    height = 22 * len(known.names) + 30
    panel = Panel("", SHARE, "", tuple(series), (prior,), log_x=True, x_range=reach, y_names=known.names, height=height)
    caption = (
        "Predicted: by the poses without load, by the loaded circles, and by one fit of both runs. Parameters that "
        "stay near their prior size in all three cannot be told apart; others carry their error."
    )
    return Chart("known", "What each run knows, and both together", caption, (panel,))
