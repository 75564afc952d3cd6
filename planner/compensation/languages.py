"""Which language a file is in: by its suffix, and where that is not known by what it says."""

import re
from collections.abc import Callable
from pathlib import Path

import planner.compensation.formats.csv as csv
import planner.compensation.formats.gcode as gcode
import planner.compensation.formats.krl as krl
import planner.compensation.formats.pdl2 as pdl2
import planner.compensation.formats.rapid as rapid
from planner.common.errors import InputError
from planner.compensation.dialect_words import DialectWords, dialect_named, dialect_words
from planner.compensation.targets import TargetReading

Reader = Callable[[str, DialectWords, TargetReading], None]
READERS: dict[str, Reader] = {"gcode": gcode.read, "krl": krl.read, "rapid": rapid.read, "pdl2": pdl2.read}
MORE_SUFFIXES = {".csv": "csv", ".sys": "rapid", ".modx": "rapid", ".spf": "sinumerik"}
CONTENT_PATTERNS = {
    "krl": r"^\s*(&ACCESS|DEF(DAT)?\s+\w+)",
    "rapid": r"^\s*MODULE\s+\w+",
    "pdl2": r"^\s*PROGRAM\s+\w+",
    "csv": r"^\s*[^\n]*\bq1_(deg|rad)\b",
}


def detect_dialect(path: Path, text: str) -> str:
    """Return the name of the dialect of a file, or ``csv``.

    Raises:
        InputError: neither suffix nor content tells.
    """
    suffix = path.suffix.lower()
    known = {s: name for name, words in dialect_words().items() for s in words.suffixes if s != ".csv"} | MORE_SUFFIXES
    if suffix in known:
        return known[suffix]
    for name, pattern in CONTENT_PATTERNS.items():
        if re.search(pattern, text, re.IGNORECASE | re.MULTILINE):
            return name
    raise InputError(
        f"{path}: neither the suffix '{suffix}' nor the content tells the language; suffixes that do: "
        f"{', '.join(sorted(known))}; or name the dialect (csv, {', '.join(dialect_words())})"
    )


def read_targets(name: str, text: str, reading: TargetReading) -> None:
    """Note the targets of ``text`` in the dialect ``name`` (or ``csv``).

    Raises:
        InputError: no such dialect, or it has no words for so many joints.
    """
    if name == "csv":
        csv.read(text, reading)
        return
    words = dialect_named(name)
    n = reading.robot.n_joints
    if len(words.axes) < n:
        raise InputError(f"{reading.refusals.name}: {name} has words for {len(words.axes)} axes, the robot has {n}")
    reading.axes = words.axes[:n]
    READERS[words.reading.family](text, words, reading)
