"""What the commands share: options, and how they print."""

import json
import sys
import tempfile
from pathlib import Path
from typing import Annotated, Literal

import typer

from planner.errors import InputError

Index = Literal["O1", "O2", "O3", "O4", "O5"]
CellArgument = Annotated[str, typer.Argument(metavar="CELL", help="a cell file, or robot/cell for a shipped one")]
Json = Annotated[bool, typer.Option("--json", help="print a machine-readable summary on standard output")]
Seed = Annotated[int, typer.Option(min=0, help="the same seed gives the same bytes")]


def folder(text: str) -> Path:
    """Return the folder that a person names; an empty name is no way to mean the current one."""
    if not text.strip():
        raise InputError("-o '': names no folder; '-o .' would be the one that you are in")
    return Path(text)


Output = Annotated[Path, typer.Option("-o", "--output", metavar="DIR", parser=folder, help="folder to write to")]


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
