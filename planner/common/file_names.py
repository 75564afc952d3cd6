"""Names that a file cannot have on every system: what is written on one is opened on another."""

import os
import re
from pathlib import Path

from planner.common.errors import InputError

_DEVICE = re.compile(r"(CON|PRN|AUX|NUL|COM[0-9¹²³]|LPT[0-9¹²³]|CONIN\$|CONOUT\$) *(\..*)?", re.IGNORECASE)
_SIGNS = re.compile(r'[<>:"|?*\\\x00-\x1f]')


def name_fault(name: str) -> str:
    """Return why no file can have a name on every system; empty where it can."""
    if _DEVICE.fullmatch(name):
        return "is the name of a device on Windows, whatever its ending"
    if found := _SIGNS.search(name):
        return f"has the sign {found[0]!r}, which no name on Windows may have"
    if name.endswith((" ", ".")):
        return "ends in a " + ("space" if name.endswith(" ") else "dot") + ", which Windows drops from a name"
    return ""


def check_names(path: Path) -> None:
    """Refuse a path of which a name cannot stand on every system.

    Of a path from the root, folders that are there already are not judged: nobody writes their names.

    Raises:
        InputError: naming the part, and why.
    """
    parts = [part for part in path.parts if part != path.anchor]
    above = [Path(path.anchor, *parts[: k + 1]) for k in range(len(parts))]
    for part, here in zip(parts, above, strict=True):
        # Windows drops the dots that a name ends in, and then says that such a folder is there
        exists = os.path.isdir(here) and not (os.name == "nt" and part.endswith((" ", ".")))
        if part == ".." or (path.is_absolute() and here != path and exists):
            continue
        if fault := name_fault(part):
            raise InputError(f"{path.as_posix()[:300]!r}: cannot be written: '{part[:100]}' {fault}; take another name")
