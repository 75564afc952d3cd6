"""Writes the report: one page that needs nothing else, and a PNG of each of its pictures."""

from pathlib import Path

import jinja2
from plotly.offline import get_plotlyjs

from planner.files import write_bytes, write_text
from planner.plan import Plan
from planner.report.charts import funnel, index_curve, parameters
from planner.report.data import driven, learnt, rounds
from planner.report.motion import bar, joints, speeds, tour
from planner.report.page import Section, build_page, path_facts, tour_facts
from planner.report.picture import Picture
from planner.report.printed import picture_png
from planner.report.stage import Stage, build_stage
from planner.report.stage_print import view_png
from planner.report.stage_web import player_json, view_json
from planner.report.web import figure_json

HERE = Path(__file__).parent


def write_report(plan: Plan, folder: Path) -> list[Path]:
    """Write ``report.html`` into an existing folder, and its pictures as PNGs into ``folder/pictures``.

    The same plan gives the same bytes.

    Returns:
        What was written, the page first.

    Raises:
        InputError: the folder does not exist, or may not be written.
    """
    rows = learnt(plan)
    overview = (index_curve(plan), funnel(plan), parameters(rows))
    sections = tuple(_section(plan, k) for k in range(len(plan.drives)))
    pictures = (*overview, *(p for s in sections for p in s.pictures))
    stage = build_stage(plan)
    page = _template().render(
        page=build_page(plan, rows, sections),
        overview={p.name: p for p in overview},
        figures=[(p.name, _embedded(figure_json(p))) for p in pictures],
        view=_embedded(view_json(stage)),
        player_data=_embedded(player_json(stage)),
        player=(HERE / "player.js").read_text(encoding="utf-8"),
        plotly=get_plotlyjs(),
    )
    write_text(folder / "report.html", page)
    return [folder / "report.html", *_prints(pictures, stage, folder)]


def _prints(pictures: tuple[Picture, ...], stage: Stage, folder: Path) -> list[Path]:
    place = folder / "pictures"
    if folder.is_dir():
        place.mkdir(exist_ok=True)
    drawn = [("view", view_png(stage)), *((p.name, picture_png(p)) for p in pictures)]
    paths = [place / f"{name}.png" for name, _ in drawn]
    for path, (_, data) in zip(paths, drawn, strict=True):
        write_bytes(path, data)
    return paths


def _section(plan: Plan, k: int) -> Section:
    cell, drive = plan.cell, plan.drives[k]
    way = driven(cell, drive)
    suffix = f"_{k + 1}" if len(plan.drives) > 1 else ""
    return Section(
        fixture=cell.fixtures[drive.fixture].name,
        tour_facts=tour_facts(cell, drive),
        path_facts=path_facts(cell, drive),
        tour=tour(drive, rounds(cell, drive), suffix),
        joints=joints(way, drive, suffix),
        bar=bar(cell, way, drive, suffix),
        speeds=speeds(cell, way, drive, suffix),
    )


def _template() -> jinja2.Template:
    loader = jinja2.FileSystemLoader(HERE)
    settings = jinja2.Environment(
        loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return settings.get_template("report.html.j2")


def _embedded(json_text: str) -> str:
    """Make JSON safe inside a script element: a name from a file cannot end it."""
    return json_text.replace("<", "\\u003c")
