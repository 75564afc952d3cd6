"""Writes the report: one page that needs nothing else, and a PNG of each of its pictures."""

from pathlib import Path

from plotly.offline import get_plotlyjs

from planner.files import write_bytes, write_text
from planner.plan import Plan
from planner.report.charts import foresight, funnel, index_curve, parameters
from planner.report.data import driven, learnt, rounds
from planner.report.motion import bar, contact, joints, speeds, tour
from planner.report.page import Section, build_page, path_facts, tour_facts
from planner.report.picture import Picture
from planner.report.printed import picture_png
from planner.report.stage import Stage, build_stage
from planner.report.stage_print import view_png
from planner.report.stage_web import player_json, view_json
from planner.report.template import HERE, embedded, template
from planner.report.web import figure_json


def write_report(plan: Plan, folder: Path) -> list[Path]:
    """Write ``report.html`` into an existing folder, and its pictures as PNGs into ``folder/pictures``.

    The same plan gives the same bytes.

    Returns:
        What was written, the page first.

    Raises:
        InputError: the folder does not exist, or may not be written.
    """
    rows = learnt(plan)
    ahead = (foresight(plan.foresight),) if plan.foresight else ()
    overview = (index_curve(plan), funnel(plan), parameters(rows), *ahead)
    sections = tuple(_section(plan, k) for k in range(len(plan.drives)))
    pictures = (*overview, *(p for s in sections for p in s.pictures))
    stage = build_stage(plan)
    page = template("report.html.j2").render(
        page=build_page(plan, rows, sections),
        overview={p.name: p for p in overview},
        figures=[(p.name, embedded(figure_json(p))) for p in pictures],
        view=embedded(view_json(stage)),
        player_data=embedded(player_json(stage)),
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
        fixture=cell.place_name(drive.fixture),
        tour_facts=tour_facts(cell, drive),
        path_facts=path_facts(cell, drive),
        tour=tour(drive, rounds(cell, drive), suffix),
        joints=joints(way, drive, suffix),
        bar=bar(cell, way, drive, suffix) if cell.gauge.is_bar else contact(cell, drive, suffix),
        speeds=speeds(cell, way, drive, suffix),
    )
