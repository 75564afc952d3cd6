"""The page of a study: what was found in sentences, and all of its pictures."""

from base64 import b64encode
from collections.abc import Mapping, Sequence

from planner.cell.cell import Cell
from planner.report.chart import Chart
from planner.report.page import Report


def report_overview(
    title: str,
    cell: Cell,
    summary: str,
    charts: Sequence[Chart],
    files: Sequence[tuple[str, str]],
    pictures: Mapping[str, bytes] | None = None,
) -> Report:
    """Return the page of a study.

    Args:
        title: of the page.
        cell: whose robot and gauge are named.
        summary: as the screen says it, one finding a line; the first is the heading, a key of up to 12 signs may lead.
        charts: in their order.
        files: name, and what it holds.
        pictures: PNGs that are no charts, by title; they come first.
    """
    first, *lines = summary.splitlines()
    shown = {name: b64encode(png).decode("ascii") for name, png in (pictures or {}).items()}
    rows = [(line[2:14].strip(), line[14:].strip()) for line in lines]
    content = {"title": title, "first": first, "rows": rows, "files": tuple(files), "pictures": shown}
    return Report("overview.html.j2", content, tuple(charts)).about(cell)
