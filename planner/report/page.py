"""Reports: one page that needs nothing else, and the page of a study."""

import gzip
import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path

import jinja2

from planner import __version__
from planner.cell.cell import Cell
from planner.common.files import write_text
from planner.common.result import NOT_MEASURED
from planner.common.units import to_deg, to_mm
from planner.report.cell_view import CellView
from planner.report.chart import Chart
from planner.report.formatting import count_text, digits, duration_text
from planner.report.scene import pack_scene
from planner.report.still_view import still_legend, still_view
from planner.report.svg_backend import chart_html

Row = tuple[str, ...]
FOLDER = Path(__file__).parent / "templates"
VIEW_FOLDER = Path(__file__).parent / "static" / "view"
"""What draws the cell in space, in reports and in the pages of the service."""
VIEW_SCRIPTS = ("make.js", "orbit.js", "view3d.js")  # in the order in which each needs those before it


def template_environment(folder: Path) -> jinja2.Environment:
    """Return what renders the templates of a folder: all that they show is escaped, what is missing is an error."""
    loader, missing = jinja2.FileSystemLoader(folder), jinja2.StrictUndefined
    made = jinja2.Environment(loader=loader, autoescape=True, undefined=missing, trim_blocks=True, lstrip_blocks=True)
    made.filters |= {
        "mm": lambda value, form=".3f": f"{float(to_mm(value)):{form}}",
        "deg": lambda value, form=".3f": f"{float(to_deg(value)):{form}}",
        "significant": digits,
        "duration": duration_text,
        "count": count_text,
    }
    return made


UNITS = re.compile(r"(?<=\d) (?=(?:%|mm|µm|µrad|mrad|deg|Nm|min|kg|s)(?!\w))")


def _keep_units(value: object) -> object:
    """Let a line never break between a number and its unit."""
    return UNITS.sub("\u00a0", value) if type(value) is str else value


def _whole_options(text: str) -> str:
    """Return a text as HTML in which no line breaks within an option of a command, or before a unit."""
    kept = UNITS.sub("\u00a0", escape(text, quote=False))
    return re.sub(r"--[a-z]+(-[a-z]+)*", r'<span class="whole">\g<0></span>', kept)


ENVIRONMENT = template_environment(FOLDER)
ENVIRONMENT.filters["whole_options"] = _whole_options
ENVIRONMENT.finalize = _keep_units


@dataclass(frozen=True)
class Report:
    """A page with its charts; the same contents give the same bytes.

    Attributes:
        template: of the page, in the folder of templates.
        content: what the template shows beside the charts.
        charts: in any order; the template shows each once.
        view: the cell in space, where the page shows it.
        identity: the robot, the gauge; the page's head names them. Its date is that of the file, told by the browser:
            a page holds none.
        simulated: whether nobody measured what it shows, which it then says across every sheet.
        hand_edits: a sentence on each file that a person changed after edbb wrote it.
    """

    template: str
    content: Mapping[str, object]
    charts: tuple[Chart, ...]
    view: CellView | None = None
    identity: tuple[str, ...] = ()
    simulated: bool = False
    hand_edits: tuple[str, ...] = ()

    def with_identity(self, cell: Cell, simulated: bool = False) -> "Report":
        """Return the page with the identity of a cell's robot and gauge."""
        identity = (f"robot {cell.robot.name}", cell.gauge.describe(cell))
        edits = tuple(edit.remark for edit in cell.robot.hand_edits)
        return replace(self, identity=identity, simulated=simulated, hand_edits=edits)

    def html(self) -> str:
        """Return the page.

        Raises:
            KeyError: its template shows a picture twice.
            ValueError: its template does not show every picture.
        """
        left = {c.name: chart_html(c) for c in self.charts}
        page = ENVIRONMENT.get_template(self.template).render(
            **self.content,
            identity=(f"edbb-planner {__version__}", *self.identity),
            charts={c.name: c for c in self.charts},
            view=self.view,
            simulated=NOT_MEASURED if self.simulated else "",
            hand_edits=self.hand_edits,
            drawn=lambda chart: left.pop(chart.name),
            still="" if self.view is None else still_view(self.view),
            legend=() if self.view is None else still_legend(self.view),
            scene="" if self.view is None else _safe_json(pack_scene(self.view).model_dump_json(exclude_none=True)),
            **({} if self.view is None else _view_scripts()),
        )
        if left:
            raise ValueError(f"{self.template} does not show {', '.join(left)}")
        return page

    def write(self, folder: Path) -> None:
        """Write ``report.html`` into an existing folder.

        Raises:
            InputError: the folder does not exist, or may not be written.
        """
        write_text(folder / "report.html", self.html())


def embed_report(html: str) -> str:
    """Return a report as part of another page; nothing of it runs."""
    body = re.sub(r"<script.*?</script>", "", html.partition("<body")[2].partition(">")[2], flags=re.DOTALL)
    return _shadow_root(html, body.replace("</body>", "").replace("</html>", ""))


def embed_charts(*reports: str) -> str:
    """Return the charts of a report as part of another page; of two reports those of the same name side by side."""
    figure = re.compile(r'<figure class="chart" id="(\w+)" aria-label="(.*?)">.*?</figure>', re.DOTALL)
    charts = [{m[1]: m for m in figure.finditer(html)} for html in reports]
    shared = [c[name] for name in charts[0] if all(name in c for c in charts) for c in charts]
    sections = "".join(f"<section><h3>{m[2]}</h3>{m[0]}</section>" for m in shared)
    return _shadow_root(reports[0], f'<div class="pairs">{sections}</div>') if shared else ""


def embed_still(report: str) -> str:
    """Return the still picture of a report's view, with its colours' meaning, for another page; or nothing."""
    found = re.search(r'<svg class="still".*?</svg>.*?<p class="keys quiet">.*?</p>', report, re.DOTALL)
    return _shadow_root(report, found[0].replace("</div>", "")) if found else ""


def _shadow_root(html: str, inside: str) -> str:
    """Return a part of a report with that report's style, which reaches nothing of the page around it."""
    style = "".join(re.findall(r"<style>(.*?)</style>", html, re.DOTALL))
    shown = f'<style>{style} .page {{ padding: 0; max-width: none; }}</style><div class="page">{inside}</div>'
    return f'<template shadowrootmode="open">{shown}</template>'


def _view_scripts() -> dict[str, str]:
    """Return what draws the view in space: three.js, packed, and our own scripts as parts of one module."""
    own = "".join((VIEW_FOLDER / name).read_text("utf-8") for name in VIEW_SCRIPTS)
    own = re.sub(r"^import .*\n", "", own, flags=re.MULTILINE).replace("export ", "")
    packed = gzip.compress((VIEW_FOLDER / "three" / "three.module.min.js").read_bytes(), 9, mtime=0)
    return {"three": b64encode(packed).decode("ascii"), "view_script": own}


def _safe_json(json_text: str) -> str:
    """Make JSON safe inside a script element: a name from a file cannot end it."""
    return json_text.replace("<", "\\u003c")


def report_judged_run(
    title: str,
    run: str,
    sentences: Sequence[str],
    notes: Sequence[str],
    table: tuple[str, Row, Sequence[Row]],
    chart: Chart,
    numbers: int | None = None,
) -> Report:
    """Return the page of a run by which a robot is judged: what is found, the chart, a table (heading, head, rows).

    ``numbers`` columns of it behind the first hold numbers, or all.
    """
    heading, head, rows = table
    content = {"title": title, "run": run, "sentences": sentences, "notes": notes, "chart": chart, "table": heading}
    numeric = range(1, 1 + (len(head) - 1 if numbers is None else numbers))
    return Report("judged.html.j2", content | {"head": head, "rows": rows, "numeric": numeric}, (chart,))


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
    return Report("overview.html.j2", content, tuple(charts)).with_identity(cell)


def _columns(line: str) -> tuple[str, str]:
    """Return the key that leads a line of the screen, or nothing, and its text."""
    most = 12  # signs of a key
    found = re.match(rf"  (.{{0,{most}}}?) {{2,}}(?=\S)", line)
    return ("", line.strip()) if found is None else (found[1].strip(), line[found.end() :].strip())
