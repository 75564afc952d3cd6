"""A column map proposed from the titles of a foreign table: a person looks at it before it is used."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from planner.common.errors import InputError, LookFirst
from planner.common.files import write_text
from planner.common.numbers import number_of
from planner.common.summary import fact_lines
from planner.runs.foreign_table import ForeignTable, foreign_table
from planner.runs.table import find_column
from planner.runs.text import read_lines
from planner.runs.title_units import BRACKETS, OTHER_UNITS, UNIT, UNITS

USUAL_ENCODING = "utf-8"
OTHER_ENCODINGS = ("cp1252", "utf-16")  # what a spreadsheet of Windows writes
MEANINGS = (  # what a title means, by its words without the unit; {n} is the number that stands in it
    (r"(?:cmd|soll|target|set ?point)[\W_]*(?:joint|axis|achse|gelenk|[jqa])?[\W_]*(?P<n>[0-9])", "cmd{n}"),
    (r"(?:joint|axis|achse|gelenk|theta|act|ist|actual|[jqa])[\W_]*(?:joint|axis|[jqa])?[\W_]*(?P<n>[0-9])", "q{n}"),
    (r"(?:pose|point|punkt|nr|no|number|nummer|index|#)", "pose"),
    (r"(?:time|zeit|timestamp|t)", "t"),
    (r"(?:temperature|temperatur|temp)", "temperature"),
    (r"(?:length|länge|laenge|distance|abstand|bar|gauge|reading|messwert|l)", "length"),
    (r"(?:ball|socket|kugel)", "ball"),
    (r"(?:.*\W)?(?P<n>[xyz])(?:\W*(?:pos|position|ist|act))?", "{n}"),
)
OF_JOINT = re.compile(r"(q|cmd)\d")
VECTOR = ("x", "y", "z")  # coordinates of one place have one unit
USUAL = {"q": "deg", "cmd": "deg", "t": "s", "temperature": "degC", "length": "mm", "x": "mm", "y": "mm", "z": "mm"}


def _read_foreign(path: Path) -> tuple[ForeignTable | None, str]:
    """Return how a table is written, and its encoding.

    Raises:
        InputError: it cannot be read, or in none of the usual encodings.
    """
    try:
        return foreign_table(read_lines(path, USUAL_ENCODING)), USUAL_ENCODING
    except InputError as err:
        for encoding in OTHER_ENCODINGS:
            with suppress(InputError):
                return foreign_table(read_lines(path, encoding)), encoding
        raise err


def proposed_map(traces: Sequence[Path]) -> str:
    """Return the text of a map that reads tables as their titles are understood, to be looked at by a person.

    Raises:
        InputError: a file cannot be read, or has no columns with titles.
    """
    parts = [_trace_lines(path, "traces." if k else "") for k, path in enumerate(traces)]
    return (
        "\n".join(
            (
                "# Proposed from the titles of the columns: look at each line before it is used.",
                'schema = "edbb-map/1"',
                '# axes_of = "krl"  # where the angles are a controller\'s: its language (edbb dialects), and then',
                '# robot = "robot.toml"  # shipped, or its file beside this one: says how the controller counts',
                *(line for part in parts for line in part),
            )
        )
        + "\n"
    )


def _trace_lines(path: Path, table_name: str) -> Iterator[str]:
    """Return the lines of the map that read one trace."""
    table, encoding = _read_foreign(path)
    if table is None:
        raise InputError(f"{path}: has no columns with titles; a map with a pattern reads it (docs/how-to/run.md)")
    known = dict(_quantities_of_titles(table))
    if not known:
        raise InputError(
            f"{path}: no title is understood that has numbers below it (found in line {table.skip + 1}: "
            f"{', '.join(repr(t) for t in table.titles if t)}): take a second row of titles out, or write the map by "
            "hand (docs/how-to/run.md)"
        )
    counted = "  # counted from 0 there" if _first_joint(table) == 0 else ""
    if table_name:
        yield f"\n[[traces]]  # {path.name}"
    yield from _form_lines(table, encoding)
    yield f"\n[{table_name}columns]  # quantity = title of its column"
    for k, name in known.items():
        joint = counted if OF_JOINT.match(name) else ""
        yield f"{name} = {_column_text(table, k, name)}{_doubt(table, k)}{joint}"
    for k, title in enumerate(table.titles):
        if k not in known:
            yield f"# not understood: {_toml_text(title)}{_unknown_unit_text(table.title_with_unit(k), title)}"


def _form_lines(table: ForeignTable, encoding: str) -> Iterator[str]:
    """Yield the lines of the map that say how a table is written."""
    yield f"separator = {_toml_text(table.separator)}"
    if table.decimal != ".":
        yield f'decimal = "{table.decimal}"'
    if encoding != USUAL_ENCODING:
        yield f'encoding = "{encoding}"'
    if table.skip:
        lines = "line 1 stands" if table.skip == 1 else f"lines 1 to {table.skip} stand"
        yield f"skip_rows = {table.skip}  # {lines} above the titles"
    if table.has_units:
        yield "unit_rows = 1  # the row below the titles holds their units"


def _quantities_of_titles(table: ForeignTable) -> Iterator[tuple[int, str]]:
    """Return the columns whose titles are understood, and the quantity with its unit; each quantity once."""
    taken: set[str] = set()
    for k, title in enumerate(table.titles):
        name = title if find_column(title) else _quantity_of(table, k)
        if name is not None and name not in taken and (table.numbers(k) or name == "ball"):
            taken.add(name)
            yield k, name


def _quantity_of(table: ForeignTable, column: int) -> str | None:
    """Return the quantity that a title means, with its unit: ``q1_deg`` of ``J1``."""
    words, said = _without_unit(table.title_with_unit(column))
    for pattern, name in MEANINGS:
        if match := re.fullmatch(pattern, words.strip().rstrip(".:"), re.IGNORECASE):
            number = match.groupdict().get("n", "").lower()
            key = name.format(n=int(number) + 1 - _first_joint(table) if number.isdigit() else number)
            full = f"{key}_{_own_unit(key, said) or _usual_unit(table, column, key)}".rstrip("_")
            return full if find_column(full) else None
    return None


def _own_unit(key: str, said: str) -> str:
    """Return the run's unit of a quantity whose title says a unit: itself, or the one that it is brought to."""
    own = UNITS.get(said, "")
    if said in OTHER_UNITS and (not own or find_column(f"{key}_{own}") is None):
        return OTHER_UNITS[said][0]
    return own


def _first_joint(table: ForeignTable) -> int:
    """Return the number by which the titles call the first joint: 0 where one of them has it, else 1."""
    return 0 if any(_meaning_of(title) in ("q0", "cmd0") for title in table.titles) else 1


def _column_text(table: ForeignTable, column: int, name: str) -> str:
    """Return how a map says where a quantity is: by its title, of a unit that no run has with the factor to its own."""
    title = table.titles[column]
    said, quoted = _without_unit(table.title_with_unit(column))[1], _toml_text(title)
    if find_column(title) or said not in OTHER_UNITS or UNITS.get(said) == name.rpartition("_")[2]:
        return quoted
    _, factor, offset = OTHER_UNITS[said]
    added = f", offset = {offset}" if offset else ""
    return f"{{ column = {quoted}, factor = {factor}{added} }}"


def _without_unit(title: str) -> tuple[str, str]:
    """Return the words of a title, and the unit that it says in small letters, empty where it says none."""
    found = UNIT.search(title)
    return (title, "") if found is None else (title[: found.start()], found[1].lower())


def _unknown_unit_text(called: str, title: str) -> str:
    """Say of a title that nobody understands that it is its unit, where only that is unknown; else nothing."""
    unit = BRACKETS.search(called)
    if unit is None or UNIT.search(called) or not _meaning_of(called[: unit.start()]):
        return ""
    return (
        f"  # the unit [{unit[1]}] is not known: write for instance length_mm = "
        f"{{ column = {_toml_text(title)}, factor = F }}, F millimetres being one of it"
    )


def _usual_unit(table: ForeignTable, column: int, key: str) -> str:
    """Return the unit of a quantity whose title says none: that of its like, else by the size of all their numbers.

    The like of a joint's angle are those of all joints, of a coordinate the others of its vector.
    """
    stem = key.rstrip("0123456789")
    usual = USUAL.get(stem, "")
    stems = VECTOR if stem in VECTOR else (stem,)
    like = [k for k, title in enumerate(table.titles) if _stem_of(title) in stems] or [column]
    said = {_without_unit(table.title_with_unit(k))[1] for k in like} - {""}
    if len(said) == 1 and (own := UNITS.get(said.pop(), "")) and find_column(f"{key}_{own}"):
        return own
    largest = max((abs(v) for k in like for v in table.numbers(k)), default=0.0)
    if usual == "deg" and largest < 7.0:  # [rad] joints that all stay below one turn are taken for radians
        return "rad"
    return "m" if usual == "mm" and largest < 10.0 else usual  # [m] no run has all of its lengths below 10 mm


def _stem_of(title: str) -> str:
    return _meaning_of(title).rstrip("0123456789")


def _meaning_of(title: str) -> str:
    """Return the meaning of a title and the number in it; empty where it is not understood."""
    words, _ = _without_unit(title)
    for pattern, name in MEANINGS:
        if match := re.fullmatch(pattern, words.strip().rstrip(".:"), re.IGNORECASE):
            return name.format(n=match.groupdict().get("n", "")).lower()
    return ""


def _doubt(table: ForeignTable, column: int) -> str:
    """Return a remark where the title says no unit, and the numbers had to."""
    title = table.titles[column]
    if find_column(title) or _without_unit(table.title_with_unit(column))[1] or _stem_of(title) not in USUAL:
        return ""
    return "  # the title says no unit: is this one true?"


def _toml_text(text: str) -> str:
    """Return a text as TOML writes it."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\t", "\\t")
    return f'"{escaped}"'


def write_proposed_map(traces: Sequence[Path], target: Path) -> None:
    """Write a map of the traces where there is none yet, and say so.

    Raises:
        LookFirst: always: the map is to be looked at before anything is read through it.
    """
    text = proposed_map(traces)
    write_text(target, text)
    lines = text.splitlines()
    left = sum(line.startswith("# not understood") for line in lines)
    doubts = sum("is this one true?" in line for line in lines)
    read = sum(find_column(line.partition(" = ")[0]) is not None for line in lines)
    found = [f"{number_of(read, 'column')} understood", *([f"{doubts} without a unit"] if doubts else [])]
    said = ", ".join([*found, *([f"{left} left out"] if left else [])])
    name = traces[0].name if len(traces) == 1 else f"{len(traces)} traces"
    next_ = "look at its lines, then give the same command again: nothing was read yet"
    raise LookFirst("\n".join([f"{name}: {said}", *fact_lines([("written to", str(target)), ("next", next_)])]))
