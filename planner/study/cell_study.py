"""``study()``: every finding of the study, then its tables and pictures, written together."""

import json
from collections.abc import Callable
from pathlib import Path

from threadpoolctl import threadpool_limits

import planner.study.fixture_pictures as maps
import planner.study.fixture_pictures as remedies
import planner.study.pictures as pictures
import planner.study.tables as tables
from planner.cell.cell import Cell
from planner.common.errors import InputError
from planner.common.files import write_bytes
from planner.design.observability.information import find_rule
from planner.study.basis import compute_basis
from planner.study.fixture_count import count_fixtures
from planner.study.fixture_places import map_fixture_places
from planner.study.summary import StudySummary

NAMES = (
    "correlation.csv",
    "fixture_map.csv",
    "fixture_map.png",
    "fixtures_needed.csv",
    "fixtures_needed.png",
    "identifiability.csv",
    "identifiability.png",
    "index_curve.csv",
    "index_curve.png",
    "sensitivity.csv",
    "sensitivity.png",
    "spectrum.csv",
    "study.json",
    "unseen.csv",
)


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
        files = _render_files(summary)
    _write_files(folder, {name: files[name] for name in NAMES})
    return summary


def _render_files(summary: StudySummary) -> dict[str, bytes]:
    start, places, fixtures = summary.basis, summary.places, summary.fixtures
    texts = {
        "correlation.csv": tables.correlation_csv(start),
        "fixture_map.csv": tables.map_csv(places),
        "fixtures_needed.csv": tables.fixtures_csv(fixtures, start.index),
        "identifiability.csv": tables.identifiability_csv(start),
        "index_curve.csv": tables.curves_csv(start),
        "sensitivity.csv": tables.sensitivity_csv(start),
        "spectrum.csv": tables.spectrum_csv(start),
        "unseen.csv": tables.remedies_csv(fixtures),
        "study.json": json.dumps(summary.content(), indent=1, ensure_ascii=False) + "\n",
    }
    return {name: text.encode() for name, text in texts.items()} | {
        "identifiability.png": pictures.draw_identifiability(start),
        "index_curve.png": pictures.draw_curves(start),
        "sensitivity.png": pictures.draw_sensitivity(start),
        "fixture_map.png": maps.draw_map(places),
        "fixtures_needed.png": remedies.draw_fixtures(fixtures, start.index),
    }


def _write_files(folder: Path, files: dict[str, bytes]) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as err:
        raise InputError(f"{folder}: cannot be made ({err.strerror or err})") from err
    for name, data in files.items():
        write_bytes(folder / name, data)
