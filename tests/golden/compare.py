"""Two condensed outputs held against each other: numbers to 1e-9, structure and words exactly."""

import math
import re
from dataclasses import dataclass

from tests.golden.condense import NUMBER

CLOSE = 1e-9  # relative
TINY = 1e-12  # in the units of the files: below that a number is rounding
PROSE = re.compile(r"\w+\W+\w+\W+\w+\W+\w+")  # a sentence, whose words may be improved; its numbers may not


@dataclass(frozen=True)
class Difference:
    """Where two outputs differ; ``wording`` where only the words of a sentence do."""

    where: str
    text: str
    wording: bool = False


def differences(kept, found, where=""):
    """Yield every difference of two condensed values."""
    if isinstance(kept, dict) and isinstance(found, dict):
        yield from _of_dicts(kept, found, where)
    elif isinstance(kept, list) and isinstance(found, list):
        if len(kept) != len(found):
            yield Difference(where, f"{len(kept)} entries -> {len(found)}")
        for k, (a, b) in enumerate(zip(kept, found, strict=False)):
            yield from differences(a, b, f"{where}[{k}]")
    elif isinstance(kept, str) and isinstance(found, str):
        yield from _words(kept, found, where)
    elif _number(kept) and _number(found):
        if not _close(float(kept), float(found), max(abs(float(kept)), abs(float(found)))):
            yield Difference(where, f"{kept!r} -> {found!r}")
    elif kept != found:
        yield Difference(where, f"{kept!r} -> {found!r}")


def _of_dicts(kept, found, where):
    if set(kept) == {"sum", "scale"} == set(found):
        if not _close(kept["sum"], found["sum"], max(kept["scale"], found["scale"])):
            yield Difference(where, f"{kept['sum']!r} -> {found['sum']!r}")
        return
    for key in [*kept, *(k for k in found if k not in kept)]:
        here = f"{where}/{key}" if where else str(key)
        if key not in found or key not in kept:
            yield Difference(here, "is gone" if key not in found else "is new")
        else:
            yield from differences(kept[key], found[key], here)


def _words(kept, found, where):
    if kept == found:
        return
    same = re.fullmatch(NUMBER, kept.strip()) and re.fullmatch(NUMBER, found.strip())
    if same and _close(float(kept), float(found), abs(float(kept))):
        return
    wording = bool(PROSE.search(kept) and PROSE.search(found)) and _figures(kept) == _figures(found)
    yield Difference(where, f"{kept!r} -> {found!r}", wording)


def _figures(text):
    return sorted(NUMBER.findall(text))


def _number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _close(a, b, scale):
    return a == b or (math.isnan(a) and math.isnan(b)) or abs(a - b) <= max(CLOSE * scale, TINY)
