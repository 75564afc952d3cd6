"""The page of a study: what was found in sentences, and all of its pictures."""

import re
from base64 import b64encode
from collections.abc import Mapping, Sequence

from planner.cell.cell import Cell
from planner.report.chart import Chart
from planner.report.page import Report

KEY = 12  # signs of a key at most


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
        summary: as the screen says it, one finding a line; the first is the heading, a key may lead with two spaces
            or more behind it.
        charts: in their order.
        files: name, and what it holds.
        pictures: PNGs that are no charts, by title; they come first.
    """
    first, *lines = summary.splitlines()
    shown = {name: b64encode(png).decode("ascii") for name, png in (pictures or {}).items()}
    rows = [_columns(line) for line in lines]
    content = {"title": title, "first": first, "rows": rows, "files": tuple(files), "pictures": shown}
    return Report("overview.html.j2", content, tuple(charts)).about(cell)


def _columns(line: str) -> tuple[str, str]:
    """Return the key that leads a line of the screen, or nothing, and its text."""
    found = re.match(rf"  (.{{0,{KEY}}}?) {{2,}}(?=\S)", line)
    return ("", line.strip()) if found is None else (found[1].strip(), line[found.end() :].strip())
