"""The page of a validation or of a precision test: figures, picture, every repeated centring."""

from base64 import b64encode
from dataclasses import dataclass

import numpy as np
from plotly.offline import get_plotlyjs

from planner.accuracy import Figures, Mastering, Repeats, Validation
from planner.accuracy.results import PUBLISHED_UM
from planner.report.accuracy.pictures import histogram, scatter
from planner.report.picture import Picture
from planner.report.printed import picture_png
from planner.report.template import embedded, template
from planner.report.web import figure_json
from planner.units import UM, to_mm

Row = tuple[str, ...]


def validation_report(title: str, found: Validation) -> tuple[str, bytes]:
    """Return the page and the picture (PNG) of a tracker's run. The same run, the same bytes."""
    misses = ", ".join(f"{n} by {m / UM:.0f} µm" for n, m in zip(found.nests, found.frame.misses, strict=True))
    before, after = found.before.figures, None if found.after is None else found.after.figures
    said = [f"Mean position error {_mm(before.mean)} mm, at most {_mm(before.largest)} mm, by the data sheet."]
    if after is not None:
        said.append(
            f"Calibrated: mean {_mm(after.mean)} mm, at most {_mm(after.largest)} mm, standard deviation "
            f"{_mm(after.std)} mm."
        )
    said.append(f"The tracker's frame was found from {len(found.nests)} nests; it misses {misses}.")
    said.append(found.floor.text() + ".")
    head = ("robot", "poses", "mean", "maximum", "std", *(f"{p} % within" for p, _ in before.percentiles))
    rows = [_figures("by the data sheet", before)] + ([] if after is None else [_figures("calibrated", after)])
    page = _Page(f"Accuracy of {title}", found.run.name, said, found.notes, "Position errors, in mm", head, rows)
    return _written(page, histogram(found))


def precision_report(
    title: str, run: str, found: Repeats, master: Mastering | None, notes: tuple[str, ...] = ()
) -> tuple[str, bytes]:
    """Return the page and the picture (PNG) of repeated centrings. The same run, the same bytes."""
    s = found.summary
    said = [
        f"{s.centrings} centrings of {s.poses} poses: at most {_um(s.largest)} µm from the mean of a pose, "
        f"rms {_um(s.rms)} µm, two of one pose at most {_um(s.apart)} µm apart.",
        f"The robot's repeatability and the gauge's noise, as declared, let expect an rms of {_um(found.expected)} µm.",
        f"The TriCal paper's Table 3 has three centrings within about {PUBLISHED_UM:g} µm of the master ball, by a "
        "CMM: there the arm had no part in it; here what its joint angles do not show counts too.",
    ]
    if master is not None:
        said.append(master.text()[0].upper() + master.text()[1:] + ".")
    head = ("pose", "ball", "centring", "x", "y", "z", "distance")
    page = _Page(f"Precision of centring on {title}", run, said, notes, "Centrings, in µm", head, _centrings(found))
    return _written(page, scatter(found))


@dataclass(frozen=True)
class _Page:
    """What a page says: title, run, sentences, notes, and a table under its heading."""

    title: str
    run: str
    said: list[str]
    notes: tuple[str, ...]
    table: str
    head: Row
    rows: list[Row]


def _written(page: _Page, picture: Picture) -> tuple[str, bytes]:
    printed = picture_png(picture)
    text = template("accuracy/report.html.j2").render(
        page=page,
        picture=picture,
        printed=b64encode(printed).decode("ascii"),
        figure=embedded(figure_json(picture)),
        plotly=get_plotlyjs(),
    )
    return text, printed


def _figures(name: str, f: Figures) -> Row:
    return (name, str(f.count), _mm(f.mean), _mm(f.largest), _mm(f.std), *(_mm(v) for _, v in f.percentiles))


def _centrings(found: Repeats) -> list[Row]:
    """One row a centring, pose by pose."""
    rows, seen = list[Row](), dict[int, int]()
    for k in np.argsort(found.pose, kind="stable"):
        pose = int(found.pose[k])
        seen[pose] = seen.get(pose, 0) + 1
        off = [f"{round(v / UM, 1) + 0.0:+.1f}" for v in found.off[k]]
        rows.append((str(pose), found.ball[k], str(seen[pose]), *off, _um(float(np.linalg.norm(found.off[k])))))
    return rows


def _mm(value: float) -> str:
    return f"{float(to_mm(value)):.3f}"


def _um(value: float) -> str:
    return f"{value / UM:.1f}"
