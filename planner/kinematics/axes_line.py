"""The comment line of a table that says whose axes its angles are: ``# axes_of: pdl2``.

A line that is meant so and not understood would leave the angles in the wrong axes, so none is passed over: whatever
its case, its signs between the words or behind them, it is understood or refused.
"""

import difflib
import re
from collections.abc import Iterable

from planner.common.errors import InputError, make_printable
from planner.common.remarks import CELL_ENDS, remark_of

KEY = "axes_of"
_LINE = re.compile(r"ax[ei]s[\s_.-]*of(?![a-z0-9])[\s:=]*(?P<name>[^#]*)", re.IGNORECASE)
_PAIR = re.compile(r"(?P<key>[a-z][a-z\s_.-]{0,15}?)\s*[:=]\s*(?P<name>[^#]*)", re.IGNORECASE)
_NAME = re.compile(r"[a-z][a-z0-9+_.-]*", re.IGNORECASE)


def axes_lines(file: str, lines: Iterable[str]) -> frozenset[str]:
    """Return the languages that comment lines name as those of the angles' controller; ``model`` among them.

    Args:
        file: name of the file, for messages.
        lines: of the whole file.

    Raises:
        InputError: a line reads as if it said whose axes the angles are, and is not understood.
    """
    found = set[str]()
    for number, line in enumerate(lines, start=1):
        if "#" not in line:
            continue
        remark = remark_of(line)
        if remark is not None and (name := _name_in(f"{file}, line {number}", remark)) is not None:
            found.add(name)
    return frozenset(found)


def axes_line(file: str, lines: Iterable[str]) -> str | None:
    """Return the one language that comment lines name, ``None`` where none does.

    Raises:
        InputError: as of :func:`axes_lines`, or lines name several.
    """
    found = sorted(axes_lines(file, lines))
    if len(found) > 1:
        raise InputError(f"{file}: the angles are said to be of {' and of '.join(found)}; name one")
    return found[0] if found else None


def _name_in(where: str, remark: str) -> str | None:
    said, pair = _LINE.match(remark), _PAIR.match(remark)
    if said is not None:
        name = said["name"].strip(CELL_ENDS + "\"'")
        if _NAME.fullmatch(name):
            return name.lower()
    elif pair is None or not (_is_misspelt(pair["key"]) and _NAME.fullmatch(pair["name"].strip(CELL_ENDS + "\"'"))):
        return None
    # 80: characters of a line in a message
    raise InputError(
        f"{where}: '# {make_printable(remark[:80])}' reads as if it said whose axes the angles are, and is not "
        f"understood: '# {KEY}: pdl2' is allowed, with a language of 'edbb dialects' or model; begin another remark "
        "with another word"
    )


def _is_misspelt(key: str) -> bool:
    """Tell whether a word is nearly the one that is meant."""
    letters = re.sub("[^a-z]", "", key.lower())
    # 0.75: of equal letters, from which a word is a misspelt one: "axsof", "axeof", "axesoff", "axes"
    return difflib.SequenceMatcher(None, letters, "axesof").ratio() >= 0.75
