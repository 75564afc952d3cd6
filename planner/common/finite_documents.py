"""No number of a document is nan or infinite: all documents are checked where they are written."""

import json
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from math import isfinite
from pathlib import Path

from planner.common.errors import PlannerError


class NotFiniteError(PlannerError):
    """A number came out as nan or infinite: a fault of the planner; the message names file and place."""


_WORD = re.compile(rb"nan|inf", re.IGNORECASE)
_CELL = re.compile(r"(?:^|,)[+-]?(nan|inf|infinity)(?=,|$)", re.IGNORECASE | re.MULTILINE)
_UNIT = r"%|(?:µm|um|mm|m|µrad|mrad|rad|deg|°|s|min|h|Nm|N|kg|K|Hz|dB)(?![\w-])"
_IN_TEXT = re.compile(rf">\s*[+±-]?\s*(nan|inf)\s*<|(?<![\w.-])[+-]?(nan|inf) ?(?:{_UNIT})|± ?(nan|inf)\b")


def check_finite(path: Path, data: bytes) -> None:
    """Refuse a JSON, TOML, CSV or HTML document that holds a number which is not finite; other files pass.

    Raises:
        NotFiniteError: naming the place.
    """
    find = _FINDERS.get(path.suffix.lower())
    if find is None or not _WORD.search(data):
        return
    if place := find(data.decode("utf-8", "replace")):
        raise NotFiniteError(
            f"{path.name}: {place} came out as no finite number. This is a fault of the planner, not of your input: "
            "nothing was written. Please report it with the command and its input"
        )


def check_finite_content(content: object) -> None:
    """Refuse the content of a document that holds a number which is not finite.

    Raises:
        NotFiniteError: naming the place.
    """
    for place in _places(content):
        raise NotFiniteError(f"{place} came out as no finite number. This is a fault of the planner: please report it")


def _places(content: object, at: str = "") -> Iterator[str]:
    """Yield the places of numbers that are not finite, such as ``findings.0.probability``."""
    if isinstance(content, float):
        if not isfinite(content):
            yield at or "the number"
    elif isinstance(content, Mapping):
        for key, value in content.items():
            yield from _places(value, f"{at}.{key}" if at else str(key))
    elif isinstance(content, list | tuple):
        for k, value in enumerate(content):
            yield from _places(value, f"{at}.{k}" if at else str(k))


def _of_json(text: str) -> str:
    try:
        return next(_places(json.loads(text)), "")
    except ValueError:
        return ""  # no document of ours


def _of_toml(text: str) -> str:
    try:
        return next(_places(tomllib.loads(text)), "")
    except ValueError:
        return ""


def _of_table(text: str) -> str:
    found = _CELL.search(text)
    if found is None:
        return ""
    line = text.count("\n", 0, found.start(1)) + 1
    column = text[: found.start(1)].rpartition("\n")[2].count(",") + 1
    return f"line {line}, column {column}"


def _of_page(text: str) -> str:
    found = _IN_TEXT.search(text)
    return "" if found is None else f'"{" ".join(text[max(found.start() - 40, 0) : found.end() + 20].split())}"'


_FINDERS: dict[str, Callable[[str], str]] = {".json": _of_json, ".toml": _of_toml, ".csv": _of_table, ".html": _of_page}
