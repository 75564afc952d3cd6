"""A column map proposed from the titles of a foreign table: a person looks at it before it is used."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from planner.common.errors import InputError, LookFirst
from planner.common.files import write_text
from planner.common.numbers import number_of
from planner.common.summary import fact_lines
from planner.runs.clock_times import clock_form, date_form
from planner.runs.foreign_table import ForeignTable, foreign_table
from planner.runs.table import find_column
from planner.runs.text import read_lines
from planner.runs.title_units import BRACKETS, OTHER_UNITS, UNIT, UNITS
from planner.runs.titles import counts_from_0, is_angle_by_number, meaning_of, meanings, moved_names, without_unit

USUAL_ENCODING = "utf-8"
OTHER_ENCODINGS = ("cp1252", "utf-16")  # what a spreadsheet of Windows writes
OF_JOINT = re.compile(r"(q|cmd)\d")
TURNS = ("rx", "ry", "rz")
VECTOR = ("x", "y", "z")  # coordinates of one place have one unit
USUAL = {
    **dict.fromkeys(("q", "cmd", *TURNS), "deg"),
    **dict.fromkeys(("length", *VECTOR), "mm"),
    "t": "s",
    "temperature": "degC",
}


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
    parts, tables = list[list[str]](), list[ForeignTable]()
    for path in traces:
        table, encoding = _read_foreign(path)
        if table is None:
            raise InputError(f"{path}: has no columns; a map with a pattern reads it (docs/how-to/run.md)")
        parts.append(list(_trace_lines(path, table, encoding, "traces." if tables else "")))
        tables.append(table)
    joined = ['join = "rows"  # no time or number of the pose stands in both: is row k of one that of the other?']
    return (
        "\n".join(
            (
                "# Proposed from the titles of the columns: look at each line before it is used.",
                'schema = "edbb-map/1"',
                '# axes_of = "krl"  # where the angles are a controller\'s: its language (edbb dialects), and then',
                '# robot = "robot.toml"  # shipped, or its file beside this one: says how the controller counts',
                "#                        and lets the import find readings that stand some rows beside their angles",
                *(joined if _are_joined_by_rows(tables) else []),
                *(line for part in parts for line in part),
            )
        )
        + "\n"
    )


def _are_joined_by_rows(tables: Sequence[ForeignTable]) -> bool:
    """Tell whether two tables, one of joints and one of readings, have neither time nor pose in common."""
    if len(tables) != 2:
        return False
    known = [{name.partition("_")[0] for name in proposed_columns(table)} for table in tables]
    joints = ["q1" in keys or "cmd1" in keys for keys in known]
    return joints.count(True) == 1 and not {"t", "pose"} & known[0] & known[1]


def _trace_lines(path: Path, table: ForeignTable, encoding: str, table_name: str) -> Iterator[str]:
    """Return the lines of the map that read one trace."""
    if moved := moved_names(table):
        row, title = moved
        line = table.skip + int(table.header) + int(table.has_units) + row + 1
        raise InputError(
            f"{path}, line {line}: {title!r} names another joint than the rows before: write each joint's angle into a "
            "column of its own, in all rows the same"
        )
    known = proposed_columns(table)
    if not known:
        raise InputError(
            f"{path}: no title is understood that has numbers below it (found in line {table.skip + 1}: "
            f"{', '.join(repr(t) for t in table.titles if t)}): take a second row of titles out, or write the map by "
            "hand (docs/how-to/run.md)"
        )
    counted = "  # counted from 0 there" if counts_from_0(table) else ""
    if table_name:
        yield f"\n[[traces]]  # {path.name}"
    yield from _form_lines(table, encoding)
    yield f"\n[{table_name}columns]  # quantity = {'title' if table.header else 'number'} of its column"
    for name, column in known.items():
        joint = counted if OF_JOINT.match(name) else ""
        if OF_JOINT.match(name) and table.header and is_angle_by_number(table, column.places[0]):
            joint += "  # which joint is it? ROS often lists joints by the alphabet"
        yield f"{name} = {column.text}{column.doubt}{joint}"
    used = {k for column in known.values() for k in column.places}
    for k, title in enumerate(table.titles):
        if k not in used:
            yield f"# not understood: {_toml_text(title)}{_unknown_unit_text(table.title_with_unit(k), title)}"


def _form_lines(table: ForeignTable, encoding: str) -> Iterator[str]:
    """Yield the lines of the map that say how a table is written."""
    yield f"separator = {_toml_text(table.separator)}"
    if table.decimal != ".":
        yield f'decimal = "{table.decimal}"'
    if encoding != USUAL_ENCODING:
        yield f'encoding = "{encoding}"'
    if not table.header:
        yield "header = false  # no titles stand above the columns: what they are is guessed from their places"
    if table.skip:
        lines = "line 1 stands" if table.skip == 1 else f"lines 1 to {table.skip} stand"
        yield f"skip_rows = {table.skip}  # {lines} above the {'titles' if table.header else 'numbers'}"
    if table.has_units:
        yield "unit_rows = 1  # the row below the titles holds their units"


@dataclass(frozen=True)
class ProposedColumn:
    """How a map reads a quantity: the text of its line, the columns that it takes, and what is doubtful of it."""

    text: str
    places: tuple[int, ...]
    doubt: str = ""


def proposed_columns(table: ForeignTable) -> dict[str, ProposedColumn]:
    """Return the quantities, with their units, of the columns that are understood; each quantity once."""
    keys = meanings(table)
    out: dict[str, ProposedColumn] = {}
    for k, title in enumerate(table.titles):
        key = keys.get(k, "")
        name = title if find_column(title) else _with_unit(table, k, key, keys)
        if name in out or not name:
            continue
        if name == "t_s" and not table.numbers(k):
            if clock := _clock_column(table, k, keys):
                out[name] = clock
        elif table.numbers(k) or name == "ball":
            out[name] = _number_column(table, k, name, keys)
    return out


def _clock_column(table: ForeignTable, column: int, keys: Mapping[int, str]) -> ProposedColumn | None:
    """Return the line of a time that a clock has written, with the date where it stands in another column."""
    texts = table.texts(column)
    day = next((k for k, key in keys.items() if key == "date" and not table.numbers(k)), None)
    form, dated = clock_form(texts), None if day is None else date_form(table.texts(day))
    if form is None:
        return None
    if day is not None and dated is not None and "%d" not in form:
        text = f'{{ column = {_place(table, column)}, clock = "{dated} {form}", date = {_place(table, day)} }}'
        return ProposedColumn(text, (column, day))
    return ProposedColumn(f'{{ column = {_place(table, column)}, clock = "{form}" }}', (column,))


def _number_column(table: ForeignTable, column: int, name: str, keys: Mapping[int, str]) -> ProposedColumn:
    text, said = _place(table, column), _unit_of_title(table, column)
    more = [k for k, key in keys.items() if key == "nanoseconds"]
    if name == "t_s" and more:
        return ProposedColumn(f"{{ column = {text}, nanoseconds = {_place(table, more[0])} }}", (column, more[0]))
    if name == "t_s" and not said:
        said = _unit_of_clock(table.numbers(column))
    doubt = _doubt(table, column, keys)
    if find_column(table.titles[column]) or said not in OTHER_UNITS or UNITS.get(said) == name.rpartition("_")[2]:
        return ProposedColumn(text, (column,), doubt)
    _, factor, offset = OTHER_UNITS[said]
    added = f", offset = {offset}" if offset else ""
    return ProposedColumn(f"{{ column = {text}, factor = {factor}{added} }}", (column,), doubt)


def _place(table: ForeignTable, column: int) -> str:
    """Return how a map names a column: by its title, or its number where there are none."""
    return _toml_text(table.titles[column]) if table.header else str(column + 1)


def _unit_of_title(table: ForeignTable, column: int) -> str:
    return without_unit(table.title_with_unit(column))[1] if table.header else ""


def _unit_of_clock(seconds: Sequence[float]) -> str:
    """Return the unit of a clock that counts from 1970 in parts of a second, by the size of its numbers."""
    largest = max(map(abs, seconds), default=0.0)
    # in seconds such a clock shows 1e9 to 1e10
    return next((unit for unit, least in (("ns", 1e17), ("us", 1e14), ("ms", 1e11)) if largest > least), "")


def _with_unit(table: ForeignTable, column: int, key: str, keys: Mapping[int, str]) -> str:
    """Return a quantity with its unit: ``q1_deg`` of ``J1``; empty where it is none of a run."""
    if not key:
        return ""
    full = f"{key}_{_own_unit(key, _unit_of_title(table, column)) or _usual_unit(table, column, key, keys)}".rstrip("_")
    return full if find_column(full) else ""


def _own_unit(key: str, said: str) -> str:
    """Return the run's unit of a quantity whose title says a unit: itself, or the one that it is brought to."""
    own = UNITS.get(said, "")
    if said in OTHER_UNITS and (not own or find_column(f"{key}_{own}") is None):
        return OTHER_UNITS[said][0]
    return own


def _unknown_unit_text(called: str, title: str) -> str:
    """Say of a title that nobody understands that it is its unit, where only that is unknown; else nothing."""
    unit = BRACKETS.search(called)
    if unit is None or UNIT.search(called) or not meaning_of(called[: unit.start()]):
        return ""
    return (
        f"  # the unit [{unit[1]}] is not known: write for instance length_mm = "
        f"{{ column = {_toml_text(title)}, factor = F }}, F millimetres being one of it"
    )


def _usual_unit(table: ForeignTable, column: int, key: str, keys: Mapping[int, str]) -> str:
    """Return the unit of a quantity whose title says none: that of its like, else by the size of all their numbers.

    The like of a joint's angle are those of all joints, of a coordinate the others of its vector.
    """
    stem = _stem(key)
    usual = USUAL.get(stem, "")
    stems = next((group for group in (VECTOR, TURNS) if stem in group), (stem,))
    like = [k for k, other in keys.items() if _stem(other) in stems] or [column]
    said = {_unit_of_title(table, k) for k in like} - {""}
    if len(said) == 1 and (own := UNITS.get(said.pop(), "")) and find_column(f"{key}_{own}"):
        return own
    largest = max((abs(v) for k in like for v in table.numbers(k)), default=0.0)
    if usual == "deg" and largest < 7.0:  # [rad] joints that all stay below one turn are taken for radians
        return "rad"
    return "m" if usual == "mm" and largest < 10.0 else usual  # [m] no run has all of its lengths below 10 mm


def _stem(key: str) -> str:
    return key.rstrip("0123456789")


def _doubt(table: ForeignTable, column: int, keys: Mapping[int, str]) -> str:
    """Return a remark where the title says no unit, and the numbers had to, or where no title says anything."""
    if not table.header:
        return "  # no title says it: is this one true?"
    if find_column(table.titles[column]) or _unit_of_title(table, column) or _stem(keys.get(column, "")) not in USUAL:
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
