"""Comau PDL2: joint targets in braces, ``MOVE TO {10, -20, …}`` and ``MOVEFLY TO {…} ADVANCE``."""

import re

import numpy as np

from planner.common.units import DEG, read_only
from planner.compensation.dialect_words import DialectWords
from planner.compensation.targets import Target, TargetReading
from planner.programs.languages.text import EXPONENT_NUMBER, Lines, Slot, mask_comments

DECIMALS = 5
_MOVE = re.compile(r"^\s*MOVE(FLY)?\b(?P<how>[^{]*?)\b(TO|VIA)\s*(?P<target>\{[^}]*\}|.*)", re.IGNORECASE)
_RELATIVE = re.compile(r"\b(RELATIVE|ABOUT|BY|AWAY|NEAR|SEG)\b", re.IGNORECASE)


def read(text: str, words: DialectWords, reading: TargetReading) -> None:
    """Note the joint targets of one program."""
    n = reading.robot.n_joints
    for number, place, line in Lines.of(mask_comments(text, r"--[^\r\n]*", "'")):
        if not re.match(r"\s*MOVE(FLY)?\b", line, re.IGNORECASE):
            continue
        move = _MOVE.match(line)
        rest = "" if move is None else line[move.end("target") :]
        if move is None or not move["target"].startswith("{") or _RELATIVE.search(move["how"]) or "{" in rest:
            reading.refusals.add(
                number, f"'{line.strip()}' found; MOVE TO {{…}} and MOVEFLY TO {{…}} with plain angles are allowed"
            )
            continue
        inside = list(re.finditer(r"[^,{}]+", move["target"]))
        cells = [re.fullmatch(rf"(\s*)({EXPONENT_NUMBER})\s*", m[0]) for m in inside]
        if len(cells) != n or any(c is None for c in cells):
            reading.refusals.add(number, f"'{move['target']}' found; {n} plain angles in degrees are allowed")
            continue
        slots, q = [], []
        for match, cell in zip(inside, cells, strict=True):
            assert cell is not None
            start = place + move.start("target") + match.start() + len(cell[1])
            slots.append(Slot(start, start + len(cell[2]), DEG, DECIMALS))
            q.append(float(cell[2]) * DEG)
        reading.targets.append(Target(number, tuple(slots), q=read_only(np.array(q))))
