"""The rows of the page: what a paper says, our command and number, and the verdict that follows from the number."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from planner.common.schema import StrictModel, read_toml

Verdict = Literal["agrees", "differs", "not compared"]
Numbers = Mapping[str, Mapping[str, Any]]
"""Computed numbers: group, name of the number, value."""
ROWS = Path(__file__).with_name("rows.toml")
STORED = Path(__file__).with_name("numbers.json")


class PaperFile(StrictModel):
    """``[[papers]]``: short name and title."""

    name: str
    title: str


class RowFile(StrictModel):
    """``[[rows]]``: see the head of ``rows.toml``."""

    paper: str
    where: str
    says: str
    command: str
    ours: str
    verdict: Verdict | None = None
    within: dict[str, tuple[float, float]] = {}
    why: str = ""
    gain: str = ""


class RowsFile(StrictModel):
    """``rows.toml``."""

    papers: tuple[PaperFile, ...]
    rows: tuple[RowFile, ...]


@dataclass(frozen=True)
class Row:
    """One statement of a paper beside ours; all texts as they are shown, ``why`` with what our default gains."""

    paper: str
    where: str
    says: str
    command: str
    ours: str
    verdict: Verdict
    why: str


def stored_numbers() -> Numbers:
    """Return the numbers as they were computed when this version was made."""
    found: Numbers = json.loads(STORED.read_text(encoding="utf-8"))
    return found


def paper_titles() -> dict[str, str]:
    """Return the title of each paper by its short name."""
    return {paper.name: paper.title for paper in read_toml(ROWS, RowsFile).papers}


def rows_of(numbers: Numbers) -> tuple[Row, ...]:
    """Return all rows with these numbers in their texts."""
    return tuple(_row(file, numbers) for file in read_toml(ROWS, RowsFile).rows)


def _row(file: RowFile, numbers: Numbers) -> Row:
    groups = {*re.findall(r"\{(\w+)\[", file.ours + file.gain), *(key.partition(".")[0] for key in file.within)}
    if groups - numbers.keys():
        ours = "Not computed with this version: the command computes it."
        return Row(file.paper, file.where, file.says, file.command, ours, "not compared", "")
    gain = f"Our default: {file.gain[0].lower()}{file.gain[1:]}" if file.gain else ""
    why = " ".join(part for part in (file.why, gain) if part).format(**numbers)
    return Row(
        file.paper, file.where, file.says, file.command, file.ours.format(**numbers), _verdict(file, numbers), why
    )


def _verdict(file: RowFile, numbers: Numbers) -> Verdict:
    """Return the verdict that the row states, or the one that follows from its numbers.

    Raises:
        ValueError: the row has both, or neither.
    """
    if (file.verdict is None) != bool(file.within):
        raise ValueError(f"{ROWS.name}: {file.where}: '{file.says}' needs either 'verdict' or 'within'")
    if file.verdict is not None:
        return file.verdict
    for key, (low, high) in file.within.items():
        group, _, name = key.partition(".")
        if not low <= numbers[group][name] <= high:
            return "differs"
    return "agrees"


def count_verdicts(rows: tuple[Row, ...]) -> dict[Verdict, int]:
    """Return how many rows have each verdict."""
    every: tuple[Verdict, ...] = ("agrees", "differs", "not compared")
    return {verdict: sum(row.verdict == verdict for row in rows) for verdict in every}
