"""Every finding of the study, then its tables and pictures, written together."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from planner.cell.cell import Cell
from planner.cell.reading import load_cell
from planner.common.calls import called_with
from planner.common.console import as_word
from planner.common.content_hashes import HandEdit
from planner.common.files import write_bytes
from planner.common.progress import Progress, no_progress
from planner.common.result import FolderResult, Plot
from planner.common.summary import Summary
from planner.design.observability.information import find_rule
from planner.motion.planning_packages import require_planning_packages
from planner.report.matplotlib_backend import find_plot
from planner.report.page import Report, report_overview
from planner.studies.basis import compute_basis
from planner.studies.fixture_count import count_fixtures
from planner.studies.fixture_places import map_fixture_places
from planner.studies.pictures import (
    draw_curves,
    draw_fixtures,
    draw_identifiability,
    draw_map,
    draw_sensitivity,
    map_figure,
)
from planner.studies.study_call import StudyCall
from planner.studies.summary import TABLES, StudySummary

CHARTS = (draw_fixtures, draw_identifiability, draw_curves, draw_sensitivity)
MAP, PAGE = "fixture_map.png", "report.html"
NAMES = tuple(sorted((*TABLES, MAP, PAGE, "study.json")))
FILES = (
    ("study.json", "all findings for a program"),
    ("*.csv", "the table behind each picture, and correlation.csv, spectrum.csv, unseen.csv"),
    (MAP, "the first picture"),
)


@dataclass(frozen=True)
class StudyResult(FolderResult):
    """What can be seen in a cell.

    Attributes:
        findings: curve over the number of poses, places of fixtures, remedies, unseen directions.

    Example:
        >>> seen = study("comau-nj130/edbb")  # doctest: +SKIP
        >>> print(seen.summary())  # doctest: +SKIP
    """

    main_file = "study.json"

    findings: StudySummary
    progress: Progress = no_progress

    @property
    def hand_edits(self) -> tuple[HandEdit, ...]:
        """Return what a person changed in the robot's files."""
        return self.findings.basis.cell.robot.hand_edits

    def overview(self) -> Summary:
        """Return which parameters are seen, with how many poses and from which places."""
        return self.findings.overview()

    def next_step(self, folder: Path) -> str:
        """Say what to look at."""
        look, count = f"look at {as_word(folder / PAGE)}", self.findings.fixtures.fewest_fixtures
        if count <= len(self.findings.basis.cell.file.fixtures):
            return f"{look}; edbb plan CELL -o plan plans a session in the cell as it is"
        more = "edbb plan CELL --fixtures N -o plan".replace("N", str(count))
        return f"{look}; {more} plans with the places that show the rest"

    def content(self) -> Mapping[str, Any]:
        """Return what ``study.json`` says."""
        return self.findings.content()

    def fill(self, draft: Path) -> None:
        """Write tables, pictures and the page."""
        self.progress("pictures", 0, 0)
        with threadpool_limits(1, user_api="blas"):
            files = {name: table(self.findings).encode() for name, table in TABLES.items()}
            files |= {PAGE: self._report().html().encode(), MAP: self._map}
        for name, data in files.items():
            write_bytes(draft / name, data)

    def preview(self) -> Plot:
        """Return the map of places for the fixture."""
        return self.plot_fixture_map()

    def plot_fixture_map(self) -> Plot:
        """Return where a fixture shows how much."""
        return Plot("fixture_map", self._map, partial(map_figure, self.findings.places))

    def plot(self, name: str) -> Plot:
        """Return one of the report's charts by its name.

        Raises:
            InputError: no such chart.
        """
        return find_plot([draw(self.findings) for draw in CHARTS], name)

    @cached_property
    def _map(self) -> bytes:
        return draw_map(self.findings.places)

    def _report(self) -> Report:
        cell, charts = self.findings.basis.cell, [draw(self.findings) for draw in CHARTS]
        title = f"What can be seen of {cell.robot.title}"
        return report_overview(
            title, cell, self.overview().text(), charts, FILES, {"Where the fixture may stand": self._map}
        )


@called_with(StudyCall)
def study(asked: StudyCall) -> StudyResult:
    """Study what can be seen in a cell, with how many poses, and from which place of its fixture.

    Raises:
        InputError: unknown index.
        NoSolutionError: no candidate pose passes the filters, or too few do.
        MissingProgramError: a package of planning is not installed.

    Example:
        >>> study("comau-nj130/edbb").write("study")  # doctest: +SKIP
    """
    require_planning_packages()
    cell = asked.cell if isinstance(asked.cell, Cell) else load_cell(str(asked.cell))
    index, seed, progress = find_rule(asked.index or cell.plan.index).name, asked.seed, asked.progress
    cell.require_bar("a study is of a bar and its fixtures (edbb plan says what can be seen)")
    with threadpool_limits(1, user_api="blas"):  # the same bytes whatever number of threads there are
        start = compute_basis(cell, index, seed, progress)
        places = map_fixture_places(cell, start.pool, index, start.poses, seed, progress)
        progress("fixtures", 0, 0)
        fixtures = count_fixtures(cell, places, start.noise, seed)
        return StudyResult(StudySummary(start, places, fixtures, NAMES), progress)
