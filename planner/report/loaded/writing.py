"""Writes the report of a loaded run: one page that needs nothing else, and a PNG of each of its pictures."""

from base64 import b64encode
from pathlib import Path

from plotly.offline import get_plotlyjs

from planner.files import write_bytes, write_text
from planner.loaded import Loaded
from planner.loaded.joint import Joint
from planner.loaded.sentences import share
from planner.loaded.told import UNTOLD
from planner.report.loaded.pictures import pictures
from planner.report.picture import Picture
from planner.report.printed import picture_png
from planner.report.template import embedded, template
from planner.report.web import figure_json
from planner.report.words import sized
from planner.units import UM

URAD = 1e-6


def report_html(found: Loaded, joint: Joint | None = None) -> str:
    """Return the page. The same evaluation, the same bytes."""
    drawn = pictures(found)
    return _page(found, joint, drawn, _prints(drawn))


def write_loaded_report(found: Loaded, folder: Path, joint: Joint | None = None) -> list[Path]:
    """Write ``report.html`` into an existing folder, and its pictures as PNGs into ``folder/pictures``.

    Raises:
        InputError: the folder does not exist, or may not be written.
    """
    drawn = pictures(found)
    prints = _prints(drawn)
    write_text(folder / "report.html", _page(found, joint, drawn, prints))
    (folder / "pictures").mkdir(exist_ok=True)
    paths = [folder / "pictures" / f"{name}.png" for name in prints]
    for path, data in zip(paths, prints.values(), strict=True):
        write_bytes(path, data)
    return [folder / "report.html", *paths]


def _prints(drawn: tuple[Picture, ...]) -> dict[str, bytes]:
    return {p.name: picture_png(p) for p in drawn}


def _page(found: Loaded, joint: Joint | None, drawn: tuple[Picture, ...], prints: dict[str, bytes]) -> str:
    """Fill the page."""
    c = found.compliances
    rows = [
        (name, "–" if told == UNTOLD else sized(v / URAD), sized(s / URAD, 2), sized(p / URAD), share(s / p), told)
        for name, v, s, p, told in zip(c.names, c.value, c.std, c.prior, c.told, strict=True)
    ]
    mixed = [(k.text, share(k.std), k.told) for k in c.combinations]
    return template("loaded/report.html.j2").render(
        found=found,
        compliances=rows,
        combinations=mixed,
        together=[] if joint is None else _together(joint),
        left=() if joint is None else tuple(sized(v / UM) for v in joint.rms),
        pictures=drawn,
        prints={name: b64encode(data).decode("ascii") for name, data in prints.items()},
        figures=[(p.name, embedded(figure_json(p))) for p in drawn],
        plotly=get_plotlyjs(),
    )


def _together(joint: Joint) -> list[tuple[str, ...]]:
    """Rows of the joint fit: name, unit, change, standard deviation; lengths in mm, angles in mrad."""
    units = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "rad/Nm": ("µrad/Nm", 1e6)}
    rows: list[tuple[str, ...]] = []
    for e in joint.estimates:
        if e.std is not None:
            unit, factor = units.get(e.unit, (e.unit, 1.0))
            rows.append((e.name, unit, sized((e.value - e.nominal) * factor), sized(e.std * factor, 2)))
    return rows
