"""What the titles of somebody else's columns mean, and what columns without titles are likely to be."""

from __future__ import annotations

import re
import tomllib
from functools import cache
from itertools import pairwise

from planner.common.files import data_folder
from planner.runs.foreign_table import ForeignTable
from planner.runs.title_units import UNIT

BEFORE = r"(?:.*\W|(?:tracker|pos|position|tcp|smr|target|point|meas|measured|lt|p|m)_)?"  # what stands before x, y, z
MEANINGS = (  # what a title means, by its words without the unit; {n} is the number that stands in it
    (r"(?:cmd|soll|target|set ?point)[\W_]*(?:joint|axis|achse|gelenk|[jqa])?[\W_]*(?P<n>[0-9])", "cmd{n}"),
    (r"(?:joint|axis|achse|gelenk|theta|act|ist|actual|[jqa])[\W_]*(?:joint|axis|[jqa])?[\W_]*(?P<n>[0-9])", "q{n}"),
    (r"(?:.*[\W_])?(?:joint|axis|achse|gelenk)[\W_]*a?(?P<n>[0-9])(?:_[a-z])?(?:[/.]pos(?:ition)?)?", "q{n}"),
    (r"(?:.*[\W_])?(?:joint_?)?positions?[\W_]*(?P<n>[0-9])\W*", "q{n}"),
    (r"(?:pose|point|punkt|nr|no|number|nummer|index|#)", "pose"),
    (r"(?:.*[\W_])?(?:nanosecs?|nsecs?|nanoseconds)", "nanoseconds"),
    (r"(?:.*[\W_])?(?:time|zeit|timestamp|zeitstempel|datetime|date ?time|uhrzeit|clock|secs?|seconds)", "t"),
    (r"(?:t|elapsed)", "t"),
    (r"(?:date|datum|day|tag)", "date"),
    (r"(?:temperature|temperatur|temp)", "temperature"),
    (r"(?:length|länge|laenge|distance|abstand|bar|gauge|reading|messwert|l)", "length"),
    (r"(?:ball|socket|kugel)", "ball"),
    (r"(?:.*[\W_])?r(?P<n>[xyz])", "r{n}"),
    (r"(?:.*[\W_])?(?:orientation[\W_]*|quat(?:ernion)?[\W_]*|q)(?P<n>[wxyz])", "q{n}"),
    (BEFORE + r"(?P<n>[xyz])(?:[\W_]*(?:pos|position|ist|act|meas|measured)|_?[01])?", "{n}"),
)
NAME_OF_JOINT = re.compile(r"(?:.*[\W_])?name[\W_]*(?P<n>[0-9]+)\W*", re.IGNORECASE)
POSITION_OF_JOINT = re.compile(r"(?:.*[\W_])?(?:joint_?)?positions?[\W_]*(?P<n>[0-9]+)\W*", re.IGNORECASE)
BY_NAME = re.compile(
    r"(?:.*/)?(?P<name>(?!(?:pos|position|value)$)[A-Za-z]\w*?)(?:[/._](?:pos|position|value))?", re.IGNORECASE
)


def without_unit(title: str) -> tuple[str, str]:
    """Return the words of a title, and the unit that it says in small letters, empty where it says none."""
    axis_letter = re.fullmatch(r".*(?:joint|axis)_?[0-9]_[a-z]", title, re.IGNORECASE)  # joint_1_s of Motoman
    found = None if axis_letter else UNIT.search(title)
    return (title, "") if found is None else (title[: found.start()], found[1].lower())


def meaning_of(title: str) -> str:
    """Return the quantity that a title means, with the number in it; empty where it is not understood."""
    words = without_unit(title)[0].strip().strip("%_").rstrip(".:")
    for pattern, name in MEANINGS:
        if match := re.fullmatch(pattern, words, re.IGNORECASE):
            return name.format(n=match.groupdict().get("n", "")).lower()
    return ""


def meanings(table: ForeignTable) -> dict[int, str]:
    """Return the quantity of each column that is understood (``q1``, ``x``, ``t``), joints counted from 1."""
    if not table.header:
        return _by_place(table)
    found = {k: key for k, title in enumerate(table.titles) if (key := meaning_of(table.title_with_unit(k)) or title)}
    found = {k: key for k, key in found.items() if key != table.titles[k] or meaning_of(key)}
    if 0 in (_number(key) for key in found.values()):
        found = {k: _counted_from_1(key) for k, key in found.items()}
    return found | _by_joint_names(table)


def counts_from_0(table: ForeignTable) -> bool:
    """Tell whether the titles call the first joint 0."""
    return table.header and any(meaning_of(title) in ("q0", "cmd0") for title in table.titles)


def _number(key: str) -> int:
    match = re.fullmatch(r"(?:q|cmd)([0-9])", key)
    return int(match[1]) if match else -1


def _counted_from_1(key: str) -> str:
    return key if _number(key) < 0 else f"{key[:-1]}{_number(key) + 1}"


@cache
def names_of_joints() -> tuple[tuple[str, ...], ...]:
    """Return the names that the joints of each shipped robot have, from base to flange."""
    files = sorted(data_folder("robots").glob("*/robot.toml"))
    tables = [tomllib.loads(file.read_text(encoding="utf-8")).get("joints", []) for file in files]
    named = [tuple(str(j.get("name", "")) for j in joints) for joints in tables]
    return tuple(dict.fromkeys(names for names in named if names and all(names)))


def _by_joint_names(table: ForeignTable) -> dict[int, str]:
    """Return the joints of columns that are called after a robot's joints, in any order.

    ROS writes the names beside the angles too (``name[0]`` with ``position[0]``): the first row's then count.
    """
    called = {k: match["name"] for k, t in enumerate(table.titles) if (match := BY_NAME.fullmatch(_words(t)))}
    said = {m["n"]: table.texts(k)[0] for k, t in enumerate(table.titles) if (m := NAME_OF_JOINT.fullmatch(_words(t)))}
    for k, title in enumerate(table.titles):
        if (match := POSITION_OF_JOINT.fullmatch(_words(title))) and match["n"] in said:
            called[k] = said[match["n"]]
    for names in names_of_joints():
        if set(names) <= set(called.values()):
            return {k: f"q{names.index(name) + 1}" for k, name in called.items() if name in names}
    return {}


def moved_names(table: ForeignTable) -> tuple[int, str] | None:
    """Return the first row, from 0, in which a column of joint names holds another name, and that column's title."""
    if not table.header:
        return None
    for k in (k for k, title in enumerate(table.titles) if NAME_OF_JOINT.fullmatch(_words(title))):
        texts = table.texts(k)
        if (row := next((n for n, text in enumerate(texts) if text != texts[0]), None)) is not None:
            return row, table.titles[k]
    return None


def is_angle_by_number(table: ForeignTable, column: int) -> bool:
    """Tell whether a column is a joint only by its number in a list that ROS writes, ``position[0]``, without names."""
    numbered = bool(POSITION_OF_JOINT.fullmatch(_words(table.titles[column])))
    return numbered and not any(NAME_OF_JOINT.fullmatch(_words(title)) for title in table.titles)


def _words(title: str) -> str:
    return without_unit(title)[0].strip()


LAYOUTS = {  # numbers of columns without titles, and what these then are, behind a rising first one or without it
    1: ("length",), 3: ("x", "y", "z"), 6: ("q6",), 9: ("q6", "x", "y", "z"), 10: ("q7", "x", "y", "z"),
}  # fmt: skip


def _by_place(table: ForeignTable) -> dict[int, str]:
    """Return what columns without titles are likely to be: a time or number of the pose, joints, a reading."""
    width, found = len(table.titles), dict[int, str]()
    first = table.numbers(0)
    steps = {b - a for a, b in pairwise(first)}
    rises = not first or (len(first) > 1 and min(steps) > 0.0)
    if rises and width - 1 in (*LAYOUTS, 7):
        found[0] = "pose" if steps == {1.0} and width > 2 else "t"
    rest = width - len(found)
    keys = [key for name in LAYOUTS.get(rest, ()) for key in _spread(name)]
    if rest == 7:  # the last is a length where it is far above all angles
        angles = [abs(v) for k in range(len(found), width - 1) for v in table.numbers(k)]
        last = table.numbers(width - 1)
        is_length = bool(last) and min(last) > 0.0 and min(last) > 1.2 * max(angles, default=0.0)
        keys = [*_spread("q6"), "length"] if is_length else _spread("q7")
    start = len(found)
    return found | {start + k: key for k, key in enumerate(keys)}


def _spread(name: str) -> list[str]:
    """Return the joints up to one, such as q1 to q6 of ``q6``; other names alone."""
    return [f"q{j}" for j in range(1, int(name[1:]) + 1)] if name.startswith("q") else [name]
