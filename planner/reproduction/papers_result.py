"""``papers()``: computes the numbers of the two papers' page and writes it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from planner.common.calls import called_with
from planner.common.files import write_bytes, write_text
from planner.common.progress import Stages
from planner.common.result import FolderResult
from planner.common.summary import Summary
from planner.reproduction.numbers import compute_numbers
from planner.reproduction.papers_call import PapersCall
from planner.reproduction.rows import Numbers, count_verdicts, rows_of


@dataclass(frozen=True)
class PapersResult(FolderResult):
    """Every statement of the papers beside ours; ``numbers`` by group and name.

    Example:
        >>> papers(quick=True).numbers["model"]  # doctest: +SKIP
    """

    main_file = "numbers.json"
    numbers: Numbers

    def overview(self) -> Summary:
        """Return how many rows agree, and which differ."""
        rows = rows_of(self.numbers)
        count = count_verdicts(rows)
        facts = [(name, str(count[name])) for name in ("agrees", "differs", "not compared")]
        details = [("differs", f"{row.where}: {row.says}") for row in rows if row.verdict == "differs"]
        return Summary(f"The two papers: {len(rows)} rows", facts, details=details)

    def content(self) -> Mapping[str, Any]:
        """Return what ``numbers.json`` says."""
        return self.numbers

    def fill(self, draft: Path) -> None:
        """Write the page and its pictures."""
        from planner.reproduction.page import page_html
        from planner.reproduction.pictures import draw_pictures  # plotting takes long to load

        pictures = draw_pictures(self.numbers)
        write_text(draft / "report.html", page_html(self.numbers, pictures))
        (draft / "pictures").mkdir()
        for name, png in pictures.items():
            write_bytes(draft / "pictures" / f"{name}.png", png)

    def files(self, folder: Path) -> str:
        """Name what is written."""
        return "report.html, numbers.json, pictures"


@called_with(PapersCall)
def papers(asked: PapersCall) -> PapersResult:
    """Compute the numbers of the papers' page.

    Raises:
        MissingProgramError: a package of planning is not installed.

    Example:
        >>> papers(quick=True).write("papers")  # doctest: +SKIP
    """
    return PapersResult(compute_numbers(Stages(asked.progress), asked.quick))
