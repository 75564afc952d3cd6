"""How the files of a plan are named on the screen: a program of many parts in one go."""

import re
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path


def written_line(folder: Path, programs: Sequence[str]) -> str:
    """Say what of a plan is in a folder: first the programs, then what every plan has."""
    shown: list[str] = []
    for (stem, suffix), group in groupby(programs, key=_numbered):
        names = list(group)
        shown += [f"{names[0]} … {names[-1][len(stem) :]}"] if suffix and len(names) > 2 else names
    return f"  written to  {folder}: {', '.join(shown)}, plan.json, cell.toml, trajectory.csv, report.html"


def _numbered(name: str) -> tuple[str, str]:
    """What the parts of a split program have in common, stem and suffix; of another file its name."""
    found = re.fullmatch(r"(.*_)\d{3}(\.\w+)", name)
    return (found[1], found[2]) if found else (name, "")
