"""What the commands share: options, progress on standard error, and how results are printed."""

import json
import re
import sys
import tempfile
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from planner.common.errors import InputError

if TYPE_CHECKING:
    from planner.common.progress import Stages


Index = Literal["O1", "O2", "O3", "O4", "O5"]
CellArgument = Annotated[str, typer.Argument(metavar="CELL", help="a cell file, or robot/cell for a shipped one")]
Json = Annotated[bool, typer.Option("--json", help="print a machine-readable summary on standard output")]
Seed = Annotated[int, typer.Option(min=0, help="the same seed gives the same bytes")]


def parse_folder(text: str) -> Path:
    """Return the folder that a person names; an empty name is no way to mean the current one."""
    if not text.strip():
        raise InputError("-o '': names no folder; '-o .' would be the one that you are in")
    return Path(text)


Output = Annotated[Path, typer.Option("-o", "--output", metavar="DIR", parser=parse_folder, help="folder to write to")]


def check_folder(output: Path) -> None:
    """Refuse a file where a folder is to be written, and a place that cannot be written, before the work is done."""
    if str(output) == "-":
        raise InputError("-o needs a folder: several files are written")
    there = next(p for p in (output, *output.absolute().parents) if p.exists())
    if not there.is_dir():
        raise InputError(f"{there} is a file; -o needs a folder")
    try:
        tempfile.TemporaryFile(dir=there).close()
    except OSError as err:
        raise InputError(f"{output}: {there} may not be written ({err.strerror or err})") from err


def print_json(content: object) -> None:
    """Print the machine-readable summary."""
    sys.stdout.write(json.dumps(content, indent=1, ensure_ascii=False) + "\n")


errors = Console(stderr=True, soft_wrap=True, highlight=False)


class Screen:
    """Shows the stages of a long task."""

    def __init__(self) -> None:
        columns = (SpinnerColumn(), TextColumn("{task.description:<12}"), BarColumn(), TimeElapsedColumn())
        self._progress = Progress(*columns, console=errors, transient=True, disable=not sys.stderr.isatty())
        self._task = self._progress.add_task("starting", total=None)

    def __enter__(self) -> "Stages":
        """Start showing; returns the stages to hand to the workflow."""
        # with all its libraries: a command without stages starts quicker
        from planner.common.progress import Stages

        self._progress.start()
        return Stages(self._say)

    def __exit__(self, *_: object) -> None:
        """Stop showing; the line vanishes."""
        self._progress.stop()

    def _say(self, stage: str, done: int, of: int) -> None:
        self._progress.update(self._task, description=stage, completed=done, total=of or None)


def written_line(folder: Path, programs: Sequence[str]) -> str:
    """Say what of a plan is in a folder: first the programs, then what every plan has."""
    shown: list[str] = []
    for (stem, suffix), group in groupby(programs, key=_numbered_stem):
        names = list(group)
        shown += [f"{names[0]} … {names[-1][len(stem) :]}"] if suffix and len(names) > 2 else names
    return f"  written to  {folder}: {', '.join(shown)}, plan.json, cell.toml, trajectory.csv, report.html"


def _numbered_stem(name: str) -> tuple[str, str]:
    """What the parts of a split program have in common, stem and suffix; of another file its name."""
    found = re.fullmatch(r"(.*_)\d{3}(\.\w+)", name)
    return (found[1], found[2]) if found else (name, "")
