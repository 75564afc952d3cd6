"""Every finding of the study, then its tables and pictures, written together."""

import json
from collections.abc import Callable
from pathlib import Path

from threadpoolctl import threadpool_limits

from planner.cell.cell import Cell
from planner.common.errors import InputError
from planner.common.files import write_bytes
from planner.design.observability.information import find_rule
from planner.report.matplotlib_backend import chart_png
from planner.study.basis import compute_basis
from planner.study.fixture_count import count_fixtures
from planner.study.fixture_map_picture import draw_map
from planner.study.fixture_places import map_fixture_places
from planner.study.pictures import draw_curves, draw_fixtures, draw_identifiability, draw_sensitivity
from planner.study.summary import StudySummary
from planner.study.tables import TABLES

PICTURES: dict[str, Callable[[StudySummary], bytes]] = {
    "fixture_map.png": lambda study: draw_map(study.places),
    "fixtures_needed.png": lambda study: chart_png(draw_fixtures(study)),
    "identifiability.png": lambda study: chart_png(draw_identifiability(study)),
    "index_curve.png": lambda study: chart_png(draw_curves(study)),
    "sensitivity.png": lambda study: chart_png(draw_sensitivity(study)),
}
NAMES = tuple(sorted((*TABLES, *PICTURES, "study.json")))


def study_cell(
    cell: Cell, folder: Path, index: str | None, seed: int, say: Callable[[str, int, int], None]
) -> StudySummary:
    """Study what can be seen in a cell, and write tables, pictures and ``study.json`` into ``folder``.

    Args:
        cell: the cell.
        folder: made if it does not exist; nothing is written before everything is known.
        index: O1 … O5, or ``None`` for the cell's own.
        seed: the same seed gives the same bytes.
        say: told the stage, and how much of it is done, of how much.

    Raises:
        InputError: unknown index, or the folder cannot be written.
        NoSolutionError: no candidate pose passes the filters, or too few do.
    """
    index = find_rule(index or cell.plan.index).name
    if not cell.gauge.is_attached:
        raise InputError(
            f"{cell.path}: a study is of a bar and its fixtures, and gauge.kind is '{cell.gauge.kind}': "
            "edbb plan says what can be seen"
        )
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; a study needs a folder")
    with threadpool_limits(1, user_api="blas"):  # the same bytes whatever number of threads there are
        start = compute_basis(cell, index, seed, say)
        places = map_fixture_places(cell, start.pool, index, start.poses, seed, say)
        say("fixtures", 0, 0)
        fixtures = count_fixtures(cell, places, start.noise, seed)
        summary = StudySummary(start, places, fixtures, NAMES)
        say("pictures", 0, 0)
        files = {name: table(summary).encode() for name, table in TABLES.items()}
        files |= {name: picture(summary) for name, picture in PICTURES.items()}
    files["study.json"] = (json.dumps(summary.content(), indent=1, ensure_ascii=False) + "\n").encode()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as err:
        raise InputError(f"{folder}: cannot be made ({err.strerror or err})") from err
    for name in NAMES:
        write_bytes(folder / name, files[name])
    return summary
