"""Which language a file is in: by its suffix, and where that is not known by what it says; and who reads it."""

import re
from collections.abc import Callable
from pathlib import Path

from planner.common.errors import InputError, did_you_mean
from planner.compensation.formats import csv, fanuc, gcode, krl, pdl2, rapid, urscript
from planner.compensation.targets import TargetReading
from planner.programs.dialect import CommentStyle, Dialect, dialect_names, load_dialect

TABLE = "csv"  # stands for a table of targets among the names of dialects
READERS: dict[str, Callable[[str, Dialect, TargetReading], None]] = {
    "gcode": gcode.read,
    "krl": krl.read,
    "rapid": rapid.read,
    "pdl2": pdl2.read,
    "urscript": urscript.read,
    "fanuc": fanuc.read,
}
TP_REMARK = CommentStyle(start="   :  !", end=" ;", forbid=";[]", max_length=31)  # a statement of its own, unnumbered
HALVES = {".src": ".dat", ".dat": ".src"}
MORE_SUFFIXES = {".csv": TABLE, ".sys": "rapid", ".modx": "rapid", ".spf": "sinumerik"}
CONTENT_PATTERNS = {
    "krl": r"^[ \t]*+(&ACCESS|DEF(DAT)?\s+\w+)",
    "rapid": r"^[ \t]*+MODULE\s+\w+",
    "pdl2": r"^[ \t]*+PROGRAM\s+\w+",
    TABLE: r"^[^\n]*\bq1_(deg|rad)\b",
}


def detect_dialect(path: Path, text: str) -> str:
    """Return the name of the dialect of a file, or ``csv``.

    Raises:
        InputError: neither suffix nor content tells.
    """
    suffix = path.suffix.lower()
    read = (d for d in map(load_dialect, dialect_names()) if d.reading.family in READERS)
    own = {end.lower(): d.name for d in read for end in d.extensions}
    known = own | MORE_SUFFIXES
    if suffix in known:
        return known[suffix]
    for name, pattern in CONTENT_PATTERNS.items():
        if re.search(pattern, text, re.IGNORECASE | re.MULTILINE):
            return name
    raise InputError(
        f"{path}: neither the suffix '{suffix}' nor the content tells the language; suffixes that do: "
        f"{', '.join(sorted(known))}; or name the dialect (csv, {', '.join(dialect_names())})"
    )


def family_of(name: str) -> str:
    """Return the family of languages that a dialect belongs to, or ``csv``."""
    return TABLE if name == TABLE else load_dialect(name).reading.family


def comment_style(name: str) -> CommentStyle:
    """Return how a remark is written in a dialect, or in a table."""
    if name == TABLE:
        return CommentStyle(start="# ")
    style = load_dialect(name).comment
    return TP_REMARK if family_of(name) == "fanuc" else style


def companion_of(path: Path, name: str, read: Callable[[Path], tuple[str, str]]) -> str:
    """Return the text of the other half of a KRL module, which lies beside it, or nothing."""
    other = HALVES.get(path.suffix.lower())
    if other is None or name == TABLE or name not in dialect_names() or family_of(name) != "krl":
        return ""
    wanted = (path.stem + other).casefold()  # a controller does not tell capitals from small letters
    beside = next((p for p in sorted(path.parent.iterdir()) if p.name.casefold() == wanted), None)
    return "" if beside is None or not beside.is_file() else read(beside)[0]


def read_targets(name: str, text: str, reading: TargetReading) -> None:
    """Note the targets of ``text`` in the dialect ``name`` (or ``csv``).

    Raises:
        InputError: no such dialect, or it has no words for so many joints.
    """
    if name == TABLE:
        csv.read(text, reading)
        return
    if name not in dialect_names():
        known = dialect_names()
        raise InputError(f"no dialect '{name}'{did_you_mean(name, known)} (known: {TABLE}, {', '.join(known)})")
    dialect, n = load_dialect(name), reading.robot.n_joints
    if dialect.reading.family not in READERS:
        raise InputError(f"{reading.name}: {name} is a list of a session's moves; give the targets as a table (csv)")
    if dialect.max_joints < n:
        raise InputError(f"{reading.name}: {name} has words for {dialect.max_joints} axes, the robot has {n}")
    reading.axes = dialect.axes[:n]
    READERS[dialect.reading.family](text, dialect, reading)
