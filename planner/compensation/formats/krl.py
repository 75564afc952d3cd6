"""KUKA KRL, ``.src`` and ``.dat``: targets in braces, at the move or declared by name."""

import re
from dataclasses import dataclass, field

import numpy as np

from planner.common.units import DEG, MM, Array, read_only
from planner.compensation.dialect_words import DialectWords
from planner.compensation.formats.krl_values import (
    ACCURATE,
    EXTERNAL,
    POSE_KEYS,
    AggregateEntry,
    FrameState,
    StatusTurn,
    entries,
    transform,
)
from planner.compensation.targets import EXTERNAL_NOTE, CartesianTarget, Target, TargetReading
from planner.programs.languages.text import Lines, mask_comments

_NAME = r"\$?[A-Za-z_][\w$]*(?:\[[^\]]*\])?"
_MOVE = re.compile(r"\s*(S?PTP|S?LIN|S?CIRC|SPL)(_REL)?(?=[\s{])(.*)", re.IGNORECASE)
_DECLARED = re.compile(
    rf"\s*(?:(?:DECL|GLOBAL|CONST)\s+)*(?:(?P<type>\w+)\s+)?(?P<name>{_NAME})\s*=\s*(?P<value>\{{.*)", re.IGNORECASE
)
_ASSIGNED = re.compile(rf"\s*(?P<name>{_NAME})\s*(?P<part>\.\s*\w+)?\s*=(?!=)\s*(?P<value>.*)", re.IGNORECASE)
_FLOW = re.compile(
    r"\s*(IF|ELSE|ENDIF|FOR|ENDFOR|LOOP|ENDLOOP|WHILE|ENDWHILE|REPEAT|UNTIL|SWITCH|CASE|DEFAULT|ENDSWITCH|GOTO)\b|\s*\w+:\s*$",
    re.IGNORECASE,
)
_CALL = re.compile(
    r"\s*(?!BAS\b|PULSE\b|WAIT\b|TRIGGER\b|INTERRUPT\b|DEF\b|DEFFCT\b|GLOBAL\b)\w+\s*\(.*\)\s*", re.IGNORECASE
)
_POSITION_TYPES = ("E6AXIS", "AXIS", "E6POS", "POS")


@dataclass
class _KrlPoint:
    """A pose declared by name, with the frames of the moves that use it."""

    line: int
    found: dict[str, AggregateEntry]
    frames: list[tuple[Array | None, Array | None]] = field(default_factory=list)


def read(text: str, _words: DialectWords, reading: TargetReading) -> None:
    """Note the targets of one file."""
    _KrlTargets(text, reading).run()


class _KrlTargets:
    """What a controller knows, line by line, as far as the meaning of a target depends on it."""

    def __init__(self, text: str, reading: TargetReading) -> None:
        self.reading = reading
        self.text = mask_comments(text, r";[^\r\n]*")
        self.frames = FrameState(self.text, reading)
        self.points: dict[str, _KrlPoint] = {}
        self.used: dict[str, int] = {}
        self.assigned: dict[str, int] = {}
        self.last: int | None = None

    def run(self) -> None:
        """Note every target, declared or written at its move; refuse points that the program computes."""
        for number, place, line in Lines.of(self.text):
            if line.strip():
                self._line(number, place, line)
        for name in self.used.keys() & self.assigned.keys():
            self._refuse(self.used[name], f"{name} is computed while the program runs (line {self.assigned[name]})")
        for name, number in sorted(self.used.items(), key=lambda item: item[1]):
            if name not in self.points and name not in self.assigned:
                self.reading.notes.append(
                    (number, f"{name} is declared elsewhere: compensate the file that declares it too")
                )
        for name, point in self.points.items():
            self._declared_pose(name, point)

    def _refuse(self, line: int, sentence: str) -> None:
        self.reading.refusals.add(line, sentence)

    def _line(self, number: int, place: int, line: str) -> None:
        if match := _MOVE.match(line):
            if match[2]:
                self._refuse(
                    number, f"'{line.strip()}' moves relative to where the arm is; absolute targets are allowed"
                )
            else:
                self._move(number, place + match.start(3), match[3], match[1].upper())
        elif re.match(r"\s*(DEF|DEFFCT|END|GLOBAL\s+DEF)\b", line, re.IGNORECASE):
            self.last = None
            self.frames.forget()
        elif self.frames.statement(number, place, line):
            pass
        elif match := _DECLARED.match(line):
            self._declared(number, place + match.start("value"), match)
        elif _FLOW.match(line):
            self.last = None
            self.frames.branch(line)
        elif match := _ASSIGNED.match(line):
            if not match["part"] or match["part"].lstrip(". ").upper() in (
                *POSE_KEYS,
                "A1",
                "A2",
                "A3",
                "A4",
                "A5",
                "A6",
            ):
                self.assigned.setdefault(match["name"].upper(), number)
        elif _CALL.fullmatch(line):
            self.last = None
            self.frames.forget()

    def _move(self, number: int, place: int, rest: str, word: str) -> None:
        """Note the one target of a move, or the two of a circle."""
        at = 0
        for count in range(2 if word.endswith("CIRC") else 1):
            comma = r"\s*,\s*" if count else r"\s*"
            match = re.match(rf"{comma}(\{{[^}}]*\}}|{_NAME})", rest[at:])
            after = "" if match is None else rest[at + match.end() :].lstrip()
            if match is None or after.startswith((":", ".", "+", "-", "(")):
                self._refuse(number, f"'{word}{rest}' found; a position in braces or the name of one is allowed")
                return
            start = at + match.start(1)
            if match[1].startswith("{"):
                self._aggregate(number, place + start, match[1], word)
            else:
                self._named(number, match[1].upper())
            at += match.end()

    def _named(self, number: int, name: str) -> None:
        self.last = None
        if name.startswith("$"):
            return
        self.used.setdefault(name, number)
        if name in self.points:
            self.points[name].frames.append(self.frames.now())

    def _aggregate(self, number: int, place: int, aggregate: str, word: str) -> None:
        found = entries(aggregate, place)
        if found is None:
            self._refuse(number, f"'{aggregate}' found; plain numbers are allowed")
        elif not found.keys().isdisjoint(POSE_KEYS):
            T_FT, T_WB = self.frames.now()
            self._pose(number, found, T_FT, T_WB, inherits=word != "PTP" and word != "SPTP")
        else:
            self._joints(number, found)

    def _declared(self, number: int, place: int, match: re.Match[str]) -> None:
        """Note a position declared with its numbers; other structures are none of ours."""
        kind, name = (match["type"] or "").upper(), match["name"].upper()
        closing = match["value"].find("}")
        aggregate = match["value"][: closing + 1]
        found = entries(aggregate, place) if "{" not in aggregate[1:] else None
        if found is None:
            if kind in _POSITION_TYPES:
                self._refuse(number, f"'{aggregate}' found; plain numbers are allowed")
            return
        if kind in ("", "E6AXIS", "AXIS") and set(self.reading.axes) <= found.keys():
            self.points[name] = _KrlPoint(number, {})
            self._joints(number, found)
        elif kind in ("", "E6POS", "POS") and set(POSE_KEYS) <= found.keys() and not name.startswith("$"):
            if not kind and "S" not in found:
                return
            if name in self.points:
                self._refuse(number, f"{name} has more than one value in this file")
            self.points[name] = _KrlPoint(number, found)
        elif kind in _POSITION_TYPES:
            self._joints(number, found) if "A1" in found else self._pose(number, found, None, None, False)

    def _joints(self, number: int, found: dict[str, AggregateEntry]) -> None:
        axes = self.reading.axes
        missing = [axis for axis in axes if axis not in found]
        strange = [key for key in found if key not in (*axes, *EXTERNAL)]
        if missing or strange:
            self._refuse(
                number, f"{', '.join(found)} found; {', '.join(axes)} are needed, E1 … E6 are allowed beside them"
            )
            return
        q = np.array([found[axis].value for axis in axes]) * DEG
        self.last = len(self.reading.targets)
        self.reading.targets.append(Target(number, tuple(found[a].slot(DEG) for a in axes), q=read_only(q)))

    def _declared_pose(self, name: str, point: _KrlPoint) -> None:
        if not point.found:
            return
        frames = self.frames.of_point(name) or _common_frames(point.frames) or self.frames.given()
        self._pose(point.line, point.found, *frames, inherits=False)

    def _pose(
        self, number: int, found: dict[str, AggregateEntry], T_FT: Array | None, T_WB: Array | None, inherits: bool
    ) -> None:
        missing = [key for key in POSE_KEYS if key not in found]
        strange = [key for key in found if key not in (*POSE_KEYS, "S", "T", *EXTERNAL)]
        if missing or strange:
            self._refuse(
                number, f"{', '.join(found)} found; X, Y, Z, A, B, C are needed, S, T, E1 … E6 are allowed beside them"
            )
            return
        if T_FT is None or T_WB is None:
            lost = " and ".join(n for n, T in (("tool", T_FT), ("base", T_WB)) if T is None)
            self._refuse(number, f"the file does not say the {lost} of this pose{self.frames.hint}")
            return
        configuration, follows = self._configuration(number, found), None
        if configuration is None or (inherits and self.last is not None):
            configuration, follows = (None, self.last) if self.last is not None else (configuration, None)
        if configuration is None and follows is None:
            self._refuse(number, "the pose says no status and turn (S, T), and the target before it is not certain")
            return
        keys = [found[k].slot(MM if k in "XYZ" else DEG) for k in POSE_KEYS]
        if configuration is not None:
            keys += [found[k].slot(1.0) for k in "ST"]
        words = read_only([found[k].value * DEG for k in "ABC"])
        if any(found[k].value != 0.0 for k in EXTERNAL if k in found):
            self.reading.notes.append((number, EXTERNAL_NOTE))
        pose = CartesianTarget(transform(found), "abc", words, T_WB, T_FT, configuration)
        self.last = len(self.reading.targets)
        self.reading.targets.append(Target(number, tuple(keys), pose=pose, follows=follows))

    def _configuration(self, number: int, found: dict[str, AggregateEntry]) -> StatusTurn | None:
        if "S" not in found or "T" not in found:
            return None
        status = StatusTurn(int(found["S"].value), int(found["T"].value))
        if status.status & ACCURATE:
            self._refuse(
                number,
                f"S {status.status} marks a robot with an accuracy model of its own: the correction would count twice",
            )
        return status


def _common_frames(frames: list[tuple[Array | None, Array | None]]) -> tuple[Array | None, Array | None] | None:
    """Return tool and base if all moves to a point agree about them."""
    for frame in frames[1:]:
        for one, other in zip(frames[0], frame, strict=True):
            if one is None or other is None or not np.array_equal(one, other):
                return None, None
    return frames[0] if frames else None
