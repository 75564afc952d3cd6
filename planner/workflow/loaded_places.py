"""``study_places()``: where loaded circles tell the compliances apart, and a cell that drives them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from planner.cell.cell import Cell
from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.common.files import write_text
from planner.common.progress import Stages
from planner.common.result import Result
from planner.common.result_folder import draft_folder, move_all
from planner.instruments.loaded.circle_candidates import CirclePlaceChoice, study_circle_places, with_circles
from planner.instruments.loaded.common_fit import CommonFit, UnloadedPoses, predict_common_fit
from planner.instruments.loaded.place_results import describe_places, places_content, places_csv
from planner.instruments.loaded.results import share_text
from planner.workflow.writing import write_cell

MOST = 6
PLACES_FILES = (
    ("cell.toml", "the cell with the best circles, ready to be planned"),
    ("places.csv", "every circle that was looked at"),
    ("places.json", "these figures for a program"),
)


@dataclass(frozen=True)
class CirclePlacesResult(Result):
    """Where loaded circles tell the compliances apart.

    Attributes:
        cell: with the circle as it was given.
        found: the places.
        count: how many of them the written cell has.
        both: what the best of them and poses without load would know in one fit, where that was asked.
    """

    cell: Cell
    found: CirclePlaceChoice
    count: int
    both: CommonFit | None = None
    stages: Stages = field(default_factory=Stages)

    def summary(self) -> str:
        """Return which places there are and what they tell."""
        lines = [f"{self.cell.name}: {len(self.found.pool)} places can be driven"]
        lines += [f"  {s}" for s in describe_places(self.found)]
        for name, unloaded, loaded, together in () if self.both is None else self.both.of("compliance"):
            lines.append(
                f"  {name}: without load {share_text(unloaded)}, the {self.count} circles {share_text(loaded)}, in one "
                f"fit {share_text(together)} of its prior size"
            )
        return "\n".join(lines)

    def content(self) -> Mapping[str, Any]:
        """Return what ``places.json`` says."""
        return places_content(self.found, self.cell.robot.name, self.both)

    def write(self, folder: Path | str) -> list[Path]:
        """Write ``places.json``, ``places.csv``, the pictures, and ``cell.toml`` with the best circles."""
        # plotting: other commands start quicker without
        from planner.report.loaded_report import draw_places
        from planner.report.overview import report_overview

        with draft_folder(Path(folder)) as draft, self.stages.stage("report"):
            write_text(draft / "places.json", self.to_json())
            write_text(draft / "places.csv", places_csv(self.found))
            write_cell(with_circles(self.cell, self.found.best(self.count)), draft)
            title, charts = f"Places of loaded circles for {self.cell.robot.title}", draw_places(self.found, self.count)
            report_overview(title, self.cell, self.summary(), charts, PLACES_FILES).write(draft)
            return move_all(draft, Path(folder))

    def files(self, folder: Path) -> str:
        """Name what is written."""
        return "places.json, places.csv, cell.toml, report.html"

    def next_step(self, folder: Path) -> str:
        """Say how the circles are driven."""
        return f"edbb plan {folder / 'cell.toml'} -o circles plans the {self.count} best circles"


def study_places(cell: str, count: int, seed: int, stages: Stages, plan: Path | None = None) -> CirclePlacesResult:
    """Study the places of a cell's loaded circle; with a ``plan`` without load also what one fit of both would know.

    Raises:
        InputError: the cell has no circle under load, or so many places make no sense.
        NoSolutionError: no circle can be followed, or fewer places than asked for.
    """
    where = load_cell(cell)
    with stages.stage("places"):
        found = study_circle_places(where, max(count, MOST), seed)
    if count > len(found.sets):
        raise InputError(f"{count} places were asked for, but only {len(found.sets)} circles can be followed")
    both = None if plan is None else predict_common_fit(UnloadedPoses.read(plan), where, found.best(count))
    return CirclePlacesResult(where, found, count, both, stages)
