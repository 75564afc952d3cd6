"""Writes the report of a calibration: one page that needs nothing else, and a PNG of each of its pictures."""

from base64 import b64encode
from io import BytesIO
from pathlib import Path

from PIL import Image
from plotly.offline import get_plotlyjs

from planner.files import write_bytes, write_text
from planner.identification import Calibration
from planner.identification.leftover import Leftover
from planner.report.calibration.data import Told
from planner.report.calibration.page import build_page
from planner.report.calibration.pictures import pictures
from planner.report.picture import Picture
from planner.report.printed import picture_png
from planner.report.template import embedded, template
from planner.report.web import figure_json

COLOURS = 128


def report_html(calibration: Calibration) -> str:
    """Return the page: its first printed sheet is a summary for the customer. The same calibration, the same bytes."""
    told = Told(calibration)
    drawn = pictures(told)
    return _page(told, drawn, _prints(drawn))


def report_pictures(calibration: Calibration) -> dict[str, bytes]:
    """Return every picture as a PNG for print, name → bytes."""
    return _prints(pictures(Told(calibration)))


def write_calibration_report(calibration: Calibration, folder: Path, left: Leftover | None = None) -> list[Path]:
    """Write ``report.html`` into an existing folder, and its pictures as PNGs into ``folder/pictures``.

    ``left`` is what the tests of its residual say, where they were made before.

    Returns:
        What was written, the page first.

    Raises:
        InputError: the folder does not exist, or may not be written.
    """
    told = Told(calibration, left)
    drawn = pictures(told)
    prints = _prints(drawn)
    write_text(folder / "report.html", _page(told, drawn, prints))
    (folder / "pictures").mkdir(exist_ok=True)
    paths = [folder / "pictures" / f"{name}.png" for name in prints]
    for path, data in zip(paths, prints.values(), strict=True):
        write_bytes(path, data)
    return [folder / "report.html", *paths]


def _prints(drawn: tuple[Picture, ...]) -> dict[str, bytes]:
    return {p.name: _light(picture_png(p)) for p in drawn}


def _light(png: bytes) -> bytes:
    """Return the PNG with a small palette: a third of the size, and no eye sees it."""
    out = BytesIO()
    few = Image.open(BytesIO(png)).convert("RGB").quantize(COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    few.save(out, "PNG")
    return out.getvalue()


def _page(told: Told, drawn: tuple[Picture, ...], prints: dict[str, bytes]) -> str:
    return template("calibration/report.html.j2").render(
        page=build_page(told),
        pictures={p.name: p for p in drawn},
        prints={name: b64encode(data).decode("ascii") for name, data in prints.items()},
        figures=[(p.name, embedded(figure_json(p))) for p in drawn],
        plotly=get_plotlyjs(),
    )
