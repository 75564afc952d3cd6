"""KUKA KRL, ``.src`` and ``.dat``: targets in braces, at the move or declared by name; routines are DEFs."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import planner.programs.languages.statements as st
from planner.common.errors import InputError
from planner.programs.dialect import Dialect
from planner.programs.instructions import Program
from planner.programs.languages.execution import Execution

EXTERNAL = tuple(f"E{i}" for i in range(1, 7))
AXES = (*(f"A{i}" for i in range(1, 7)), *EXTERNAL)
POSE_KEYS = ("X", "Y", "Z", "A", "B", "C")
_NAME = r"\$?[A-Za-z_][\w$]*(?:\[[^\]]*\])?"
_WHOLE = r"'B\s*[01]+'|'H\s*[0-9A-F]+'|[0-9]+"
_TRIGGER = r"(?P<trigger>TRIGGER\s+WHEN\s.*\bDO\s+)?"


def _pattern(text: str) -> re.Pattern[str]:
    return st.compile_possessive_spaces(rf"\s*{text}", re.IGNORECASE)


_MOVE = _pattern(r"(?P<word>S?PTP|S?LIN|S?CIRC|SPL)(?P<relative>_REL)?\b(?!\s*[=.\[])(?P<rest>.*)")
_ROUTINE = _pattern(r"(?:GLOBAL\s+)?DEF(?:FCT)?\b(?:\s+(?P<name>\w{1,24})\s*\(\s*\)\s*$)?")
_END = _pattern(r"END(?:FCT)?\s*$")
_BAS = _pattern(r"BAS\s*\(\s*#(?P<what>\w+)\s*(?:,\s*(?P<value>[^)]*?)\s*)?\)")
_FLOW = _pattern(
    r"(?:(?P<opening>IF|FOR|LOOP|WHILE|REPEAT|SWITCH)|(?P<closing>ENDIF|ENDFOR|ENDLOOP|ENDWHILE|UNTIL|ENDSWITCH)"
    r"|ELSE|CASE|DEFAULT|GOTO)\b|\s*\w+:\s*$"
)
_ASSIGNED = _pattern(
    rf"(?:(?:DECL|GLOBAL|CONST)\s+)*(?:(?P<kind>\w+)\s+)?(?P<name>{_NAME})\s*(?P<part>\.\s*\w+)?\s*=(?!=)\s*(?P<value>.*)"
)
_WAIT = _pattern(r"WAIT\s+SEC\s+(\S+)\s*$")
_PULSE = _pattern(rf"{_TRIGGER}PULSE\s*\(")
_CALL = _pattern(rf"{_TRIGGER}(?!WAIT\b|INTERRUPT\b)(?P<name>\w+)\s*\(.*\)(?:\s+PRIO\s*=\s*-?\d+)?\s*$")
_PASSIVE = _pattern(r"(?:&\w+|(?:GLOBAL\s+)?INTERRUPT|WAIT\s+FOR|HALT|DECL|GLOBAL|STRUC|INT|DEFDAT|ENDDAT)\b")


@dataclass(frozen=True)
class Aggregate:
    """A value in braces; ``numbers`` by their names, or None where it holds anything but plain numbers."""

    text: str
    numbers: dict[str, st.PlacedNumber] | None


@dataclass(frozen=True)
class KrlMove(st.MotionStatement):
    """A move; ``targets`` holds values in braces and names, or nothing where it is not understood."""

    relative: bool
    targets: tuple[Aggregate | str, ...]
    rest: str


@dataclass(frozen=True)
class Bas(st.Statement):
    """A call of BAS: the name of its function, and the argument where there is one."""

    what: str
    value: str


def parse(text: str) -> Iterator[st.Statement]:
    """Yield the statements of a file, one a line, or more where braces are open or a backslash ends the line."""
    masked = st.mask_comments(text, r";[^\r\n]*")
    begun: tuple[int, int] | None = None
    for line, start, code in st.Lines.of(masked):
        first, place = begun or (line, start)
        whole = masked[place : start + len(code)]
        goes_on = whole.count("{") > whole.count("}") or whole.rstrip().endswith("\\")
        # 20: lines of one statement: beyond, a brace has been forgotten
        begun = (first, place) if goes_on and line - first < 20 else None
        if begun is None and whole.strip():
            yield _statement(re.sub(r"[\r\n\\]", " ", whole), first, place)
    if begun is not None:
        yield _statement(re.sub(r"[\r\n\\]", " ", masked[begun[1] :]), *begun)


def _statement(code: str, line: int, start: int) -> st.Statement:
    place = line, start, code.strip()
    if match := _MOVE.match(code):
        return _move(match, line, start)
    if match := _ROUTINE.match(code):
        return st.Routine(*place, (match["name"] or "").upper())
    if _END.match(code):
        return st.RoutineEnd(*place)
    if match := _BAS.match(code):
        return Bas(*place, match["what"].upper(), match["value"] or "")
    if match := _FLOW.match(code):
        return st.Flow(*place, bool(match["opening"]) - bool(match["closing"]))
    if match := _WAIT.match(code):
        return st.Waiting(*place, match[1])
    if _PULSE.match(code):
        return st.Pulse(*place)
    if match := _ASSIGNED.match(code):
        kind, name, part = ((match[k] or "").upper().lstrip(". ") for k in ("kind", "name", "part"))
        return st.Assignment(*place, kind, name, part, match["value"].strip(), start + match.start("value"))
    if match := _CALL.match(code):
        return st.Call(*place, match["name"].upper(), triggered=bool(match["trigger"]))
    return st.Passive(*place) if _PASSIVE.match(code) else st.Statement(*place)


def _move(match: re.Match[str], line: int, start: int) -> KrlMove:
    """Read the one target of a move, or the two of a circle."""
    rest, at, word = match["rest"], 0, match["word"].upper()
    targets: list[Aggregate | str] = []
    for count in range(2 if word.endswith("CIRC") else 1):
        comma = "," if count else ""
        target = re.match(rf"\s*+{comma}\s*+(\{{[^}}]*\}}|{_NAME})", rest[at:])
        after = "" if target is None else rest[at + target.end() :].lstrip()
        if target is None or after.startswith((":", ".", "+", "-", "(")):
            targets, at = [], 0
            break
        place = start + match.start("rest") + at + target.start(1)
        targets.append(aggregate(target[1], place) if target[1].startswith("{") else target[1].upper())
        at += target.end()
    return KrlMove(line, start, match[0].strip(), word, bool(match["relative"]), tuple(targets), rest[at:].strip())


def aggregate(text: str, start: int) -> Aggregate:
    """Read a value that is one pair of braces and begins at ``start``; with anything behind them it has no numbers."""
    text, behind = text[: text.find("}") + 1], text[text.find("}") + 1 :]
    if behind.strip():
        return Aggregate(text + behind, None)
    head = re.match(r"\{\s*(\w+\s*:)?", text)
    at = 0 if head is None else head.end()
    found: dict[str, st.PlacedNumber] = {}
    for cell in text[at:-1].split(","):
        match = re.fullmatch(rf"(\s*(\w+)\s+)({st.EXPONENT_NUMBER}|{_WHOLE})\s*", cell, re.IGNORECASE)
        if match is None or match[2].upper() in found:
            return Aggregate(text, None)
        found[match[2].upper()] = st.PlacedNumber(_value(match[3]), match[3], start + at + len(match[1]))
        at += len(cell) + 1
    return Aggregate(text, found)


def _value(text: str) -> float:
    if text.startswith("'"):
        return float(int(text[2:-1], 2 if text[1] in "Bb" else 16))
    return float(text)


_WORDS, _CIRCLE_WORDS = ("$RED_VEL", "$APO.CPTP"), ("$APO.CDIS", "$VEL.CP")  # variables that say how a move is driven


class KrlExecution(Execution, family="krl"):
    """The system variables that a PTP move takes its speed and its rounding from."""

    parse_file = staticmethod(parse)

    def __init__(self, dialect: Dialect, program: Program | None = None) -> None:
        super().__init__(dialect, program)
        self.values = {"$APO.CPTP": 0.0, "VEL_PTP": 100.0, "$RED_VEL": 100.0}
        self.reduces = False  # whether $RED_VEL was ever below 100
        self.words = _WORDS if program is not None and not program.has_circles else (*_WORDS, *_CIRCLE_WORDS)
        self.axes: dict[str, list[float]] = {}  # variables that hold angles, and places worked out of such

    def forget(self, stopped: bool) -> None:
        """Forget speed and rounding, and at a stop the reduction of a program that has one."""
        lost = ["$APO.CPTP", "VEL_PTP", *(["$RED_VEL"] if stopped and self.reduces else [])]
        self.values |= dict.fromkeys(lost, math.nan)

    @property
    def overall_speed(self) -> float:
        """Return the reduction of the program itself."""
        return self.values["$RED_VEL"]

    def order(self, statements: Sequence[st.Statement]) -> Iterator[st.Statement]:
        """Yield the statements from the first DEF of the first file on."""
        return st.run_order(statements)

    def execute(self, statement: st.Statement) -> bool:
        """Process a move or what decides how it is driven; motions other than joint moves raise InputError."""
        centring = self.dialect.reading.centre
        match statement:
            case KrlMove(word="CIRC"):
                self._circle(statement)
            case st.Assignment() if self._assign_axes(statement):
                pass
            case KrlMove():
                speed = self.values["VEL_PTP"] * self.overall_speed / 100.0
                blended = statement.rest.upper() == "C_PTP"
                self.move(_angles(statement), self.values["$APO.CPTP"] if blended else None, speed)
            case Bas(what="VEL_PTP", value=value):
                self.values["VEL_PTP"] = st.parse_fixed_point(value, statement.text)
            case st.Assignment(name=name, part=part, value=value) if (
                key := f"{name}.{part}".rstrip(".")
            ) in self.words:
                self.values[key] = st.parse_fixed_point(value, statement.text)
                self.reduces = self.reduces or self.values["$RED_VEL"] != 100.0
            case st.Call() if centring and (match := re.fullmatch(centring, statement.text, re.IGNORECASE)):
                self.centrings.append((len(self.moves), int(match["ball"]), int(match["pose"])))
            case _:
                return False
        return True

    def _assign_axes(self, given: st.Assignment) -> bool:
        """Process a variable with angles, or with the place of another's, and return whether it was one."""
        if place := re.fullmatch(r"FORWARD\((\w+),\w+\)", given.value, re.IGNORECASE):
            if place[1].upper() not in self.axes:
                raise InputError(f"'{given.text}': nothing was given to {place[1]}")
            self.axes[given.name] = list(self.axes[place[1].upper()])
            return True
        if given.value.startswith("{") and not given.part and given.kind == "" and given.name.startswith("AX_"):
            self.axes[given.name] = _named_angles(aggregate(given.value, 0), given.text)
            return True
        return False

    def _circle(self, move: KrlMove) -> None:
        names = [t for t in move.targets if isinstance(t, str)]
        blended = move.rest.upper() == "C_DIS"
        said = len(names) == 2 and all(n in self.axes for n in names) and (blended or not move.rest)
        if not said or move.relative or not {"$VEL.CP", "$APO.CDIS"} <= self.values.keys():
            raise InputError(f"'{move.text}' is no circle as this family writes it")
        speed = 1e3 * self.values["$VEL.CP"] * self.overall_speed / 100.0
        via, end = (self.axes.pop(n) for n in names)
        self.move(end, self.values["$APO.CDIS"] if blended else None, speed, via)


def _angles(move: KrlMove) -> list[float]:
    target = move.targets[0] if move.targets else ""
    if move.word != "PTP" or move.relative or isinstance(target, str) or move.rest.upper() not in ("", "C_PTP"):
        raise InputError(f"'{move.text}' is no joint move of this family")
    return _named_angles(target, move.text)


def _named_angles(target: Aggregate, where: str) -> list[float]:
    found = target.numbers or {}
    if not found or tuple(found) != AXES[: len(found)]:
        raise InputError(f"{target.text} does not name the axes in order, each once and with a number")
    return [st.parse_fixed_point(number.text, where) for number in found.values()]
