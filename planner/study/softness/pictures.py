"""Pictures of the study of places: what each number of circles knows, and where they are."""

import numpy as np

from planner.report.picture import BLACK, GREY, JOINTS, RED, SKY, Limit, Panel, Picture, Series
from planner.report.words import sized
from planner.study.softness.both import Both
from planner.study.softness.choice import Places
from planner.units import to_mm


def place_pictures(found: Places, count: int) -> tuple[Picture, ...]:
    """Return every picture, the places of the best set of ``count`` marked."""
    return (learnt(found), where(found, count))


def learnt(found: Places) -> Picture:
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
        limits=(Limit(1.0, "prior size", below=True),),
        log_y=True,
        y_range=(float(low), 1.3),
        height=330,
    )
    return Picture(
        "learnt", "What more places tell", "Predicted, with the loads and repeats of the cell's circle.", (panel,)
    )


def where(found: Places, count: int) -> Picture:
    """Centres of the circles, in the upright plane through axis 1, a panel for each plane of the circle."""
    chosen = {int(i): k + 1 for k, i in enumerate(found.sets[count - 1])}
    panels = []
    for plane in ("XY", "XZ", "YZ"):
        own = [i for i, c in enumerate(found.pool) if c.plane == plane]
        series = [_points(found, own, GREY, 6.0, f"{plane}")]
        marked = [i for i in own if i in chosen]
        if marked:
            series.append(_points(found, marked, RED, 11.0, "chosen", tuple(str(chosen[i]) for i in marked)))
        panels.append(
            Panel(
                f"circles in {plane}",
                "distance from axis 1 (mm)",
                "height (mm)",
                tuple(series),
                x_range=_range(found, 0),
                y_range=_range(found, 1),
                height=230,
            )
        )
    caption = (
        f"Grey: every circle that the arm can follow within limits and cones. Red: the {count} that know the "
        "compliances best together. Turning all of it about axis 1 changes nothing."
    )
    return Picture("where", "Where the circles are", caption, tuple(panels))


def _points(
    found: Places, which: list[int], colour: str, size: float, name: str, texts: tuple[str, ...] = ()
) -> Series:
    at = np.array([_place(found, i) for i in which]).reshape(-1, 2)
    hover = tuple(f"{name} at {sized(float(x), 4)}, {sized(float(z), 4)} mm" for x, z in at)
    return Series(name, at[:, 0], at[:, 1], colour or BLACK, "points", hover=hover, texts=texts, size=size)


def _place(found: Places, i: int) -> tuple[float, float]:
    x, y, z = to_mm(found.pool[i].centre)
    return float(np.hypot(x, y)), float(z)


def _range(found: Places, axis: int) -> tuple[float, float]:
    values = np.array([_place(found, i)[axis] for i in range(len(found.pool))])
    pad = 0.08 * float(np.ptp(values)) + 50.0
    return float(values.min()) - pad, float(values.max()) + pad


def known_by_both(known: Both) -> Picture:
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
            hover=tuple(f"{n}: {sized(float(v))} of its prior size" for n, v in zip(known.names, part, strict=True)),
        )
        for text, part, colour in kinds
    )  # fmt: skip
    low = 10.0 ** np.floor(np.log10(known.both.min()))
    panel = Panel(
        "",
        "standard deviation / prior size",
        "",
        series,
        limits=(Limit(1.0, "prior size", upright=True),),
        log_x=True,
        x_range=(float(low), 2.0),
        y_names=known.names,
        height=22 * len(known.names) + 30,
    )
    caption = (
        "Predicted: by the poses without load, by the loaded circles, and by one fit of both runs. Parameters that "
        "stay near their prior size in all three cannot be told apart; others carry their error."
    )
    return Picture("known", "What each run knows, and both together", caption, (panel,))
