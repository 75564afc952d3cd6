"""Plain pose lists: a table (CSV) or a JSON object, one step a row or an entry of ``steps``."""

import csv
import json
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

import planner.programs.languages.statements as st
from planner.common.errors import InputError
from planner.programs.languages.execution import Execution

ROW = "a row of the kind"  # that stands in dialect.toml for what the language has no line for
HEAD = re.compile(r"kind,pose,(?P<axes>(?:q\d+_(?:deg|mm),)+)duration_s,blend_mm,seconds_s,text")
ALLOWED = {
    "move": {"kind", "pose", "q_deg", "q", "duration_s", "blend_mm"},
    "dwell": {"kind", "seconds_s"},
    "mark": {"kind", "pose"},
    "pause": {"kind", "text"},
    "wait": {"kind", "text"},
    "comment": {"kind", "text"},
}


@dataclass(frozen=True)
class ListedMove(st.MotionStatement):
    """A move with its angles [deg], its time [s] and how far its corner may be cut [mm]; ``None``: it ends at rest."""

    angles: tuple[float, ...]
    seconds: float
    blend: float | None


def parse(text: str) -> Iterator[st.Statement]:
    """Yield the steps of a table, or of a JSON object."""
    if text.lstrip().startswith("{"):
        yield from _parse_json(text)
        return
    width: int | None = None
    for line, row in enumerate(text.splitlines(), start=1):
        place = line, 0, row.strip()
        if not row.strip() or row.startswith("#"):
            continue
        if width is None and (match := HEAD.fullmatch(row)):
            width = match["axes"].count(",")
            numbers = re.findall(r"q(\d+)", match["axes"])
            if numbers != [str(i) for i in range(1, width + 1)]:
                raise InputError(f"line {line}: the columns q1_deg, q2_deg ... do not follow one another")
        elif width is None:
            yield st.Statement(*place)
        else:
            yield _step_of_row(place, row, width)


def _step_of_row(place: tuple[int, int, str], row: str, width: int) -> st.Statement:
    cells = next(csv.reader([row]))
    if len(cells) != width + 6:
        return st.Statement(*place)
    kind, pose, *angles, seconds, blend, dwell, text = cells
    found: dict[str, object] = {"kind": kind}
    numbers = {"pose": pose, "duration_s": seconds, "blend_mm": blend, "seconds_s": dwell}
    for key, cell in numbers.items():
        if cell:
            found[key] = st.parse_fixed_point(cell, f"line {place[0]}: {key}")
    if any(angles):
        found["q_deg"] = [st.parse_fixed_point(cell, f"line {place[0]}: an angle") for cell in angles]
    if text:
        found["text"] = text
    return _step(place, found)


def _step(place: tuple[int, int, str], found: dict[str, object]) -> st.Statement:
    kind = str(found.get("kind"))
    if not set(found) <= ALLOWED.get(kind, set()):
        return st.Statement(*place)
    if kind == "move":
        angles, seconds, blend = found.get("q_deg", found.get("q")), found.get("duration_s"), found.get("blend_mm")
        if isinstance(angles, list) and isinstance(seconds, float) and (blend is None or isinstance(blend, float)):
            return ListedMove(*place, kind, tuple(angles), seconds, blend)
        raise InputError(f"step {place[0]}: '{place[2]}' is no joint move of this family")
    if kind == "dwell" and isinstance(seconds := found.get("seconds_s"), float):
        return st.Waiting(*place, f"{seconds:.6f}")
    known = {"mark": st.Pulse, "comment": st.Passive, "pause": st.Passive, "wait": st.Passive}.get(kind, st.Statement)
    return known(place[0], place[1], f"{ROW} {kind}" if kind in ("pause", "wait", "mark") else kind)


def _parse_json(text: str) -> Iterator[st.Statement]:
    try:
        read = json.loads(text, parse_int=float, parse_float=_plain_number, object_pairs_hook=_check_unique)
    except (json.JSONDecodeError, RecursionError) as err:
        raise InputError(f"it is no JSON: {err}") from err
    if not isinstance(read, dict):
        raise InputError("it is no JSON object")
    steps = [read] if "kind" in read else read.get("steps")
    if not isinstance(steps, list) or set(read) - (
        {"plan_id", "robot", "joint_units", "steps"} if "kind" not in read else set(read)
    ):
        raise InputError("the keys are plan_id, robot and steps, a list")
    for number, found in enumerate(steps, start=1):
        place = number, 0, json.dumps(found)
        yield _step(place, found) if isinstance(found, dict) else st.Statement(*place)


def _plain_number(text: str) -> float:
    value = float(text) if re.fullmatch(st.NUMBER, text) else math.nan
    if not math.isfinite(value):
        raise InputError(f"'{text}' is no number in fixed point")
    return value


def _check_unique(pairs: list[tuple[str, object]]) -> dict[str, object]:
    if len({key for key, _ in pairs}) != len(pairs):
        raise InputError(f"a key stands twice among {', '.join(key for key, _ in pairs)}")
    return dict(pairs)


class ListExecution(Execution, family="list"):
    """Every step says all of itself."""

    parse_file = staticmethod(parse)

    def execute(self, statement: st.Statement) -> bool:
        """Process a move."""
        if isinstance(statement, ListedMove):
            self.move(statement.angles, statement.blend, statement.seconds)
        return isinstance(statement, ListedMove | st.Passive | st.Pulse)
