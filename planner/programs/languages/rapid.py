"""ABB RAPID: jointtarget and robtarget, declared by name or written at the move; statements end with a semicolon."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import planner.programs.languages.statements as st
from planner.common.errors import InputError
from planner.programs.languages.execution import Execution


def _row(count: int) -> str:
    return r"\[\s*" + r"\s*,\s*".join([st.EXPONENT_NUMBER] * count) + r"\s*\]"


POSE = rf"\[\s*{_row(3)}\s*,\s*{_row(4)}\s*\]"
JOINT_TARGET = re.compile(rf"\[\s*{_row(6)}\s*,\s*{_row(6)}\s*\]")
ROB_TARGET = re.compile(rf"\[\s*{_row(3)}\s*,\s*{_row(4)}\s*,\s*{_row(4)}\s*,\s*{_row(6)}\s*\]")
UNUSED_AXIS = 8e9  # external axes that are not there read 9E9


def _pattern(text: str) -> re.Pattern[str]:
    return st.compile_possessive_spaces(text, re.IGNORECASE | re.DOTALL)


_CHUNK = _pattern(
    r"\s*(?:(?P<routine>(?:LOCAL\s+)?(?:PROC|TRAP|FUNC\s+\w+)\s+(?P<name>\w+)\s*(?:\([^()]*\))?)"
    r"|(?P<end>END(?:PROC|TRAP|FUNC)\b)"
    r"|(?P<module>ENDMODULE\b|MODULE\s+\w+\s*(?:\([^()]*\))?)"
    r"|(?P<flow>(?:IF|ELSEIF)\b[^;]*?\bTHEN\b|(?:WHILE|FOR)\b[^;]*?\bDO\b|(?:ELSE|ENDIF|ENDWHILE|ENDFOR|ENDTEST)\b)"
    r"|(?P<statement>[^;]+;))"
)
_DECLARED = _pattern(
    r"\b(?:CONST|PERS|VAR)\s+(?P<kind>\w+)\s+(?P<name>\w+)\s*(?P<part>\{[^{}]*\})?\s*:=\s*(?P<value>.*)"
)
_MOVE = _pattern(
    r"\b(?P<word>(?:Move|Trigg)(?:AbsJ|J|L|C)(?:DO|AO|GO|Sync|IOs)?|Search[LC]|(?:Arc|Cap|Disp|Paint)[LC](?:Start|End|\d)*"
    r"|Spot[LJ])\b(?P<rest>.*)"
)
_ASSIGNED = _pattern(
    r"(?:^|\s)(?P<kind>)(?P<name>\w+)\s*(?P<part>\{[^{}]*\})?(?:\s*\.\s*\w+(?:\s*\{[^}]*\})?)*\s*:=\s*(?P<value>.*)"
)
_PASSIVE = _pattern(r"(?:VAR|AccSet|SetDO|WaitDI|GripLoad|Open|Close|Write|TPWrite|Stop)\b.*")


@dataclass(frozen=True)
class Argument:
    """One argument of a call, without the spaces around it, and its place."""

    text: str
    start: int


@dataclass(frozen=True)
class RapidMove(st.MotionStatement):
    """A move with its arguments; those that begin with a backslash are left out."""

    arguments: tuple[Argument, ...]


def parse(text: str) -> Iterator[st.Statement]:
    """Yield the statements of a module, the names of its routines in lower case."""
    text = st.mask_comments(text, r"![^\r\n]*")
    lines = st.Lines.of(text)
    at = 0
    while match := _CHUNK.match(text, at):
        start, at = match.start(match.lastgroup or 0), match.end()
        if match["statement"]:
            yield _statement(match["statement"][:-1], start, lines)
            continue
        place = lines.number(start), start, text[start:at].strip()
        if match["routine"]:
            yield st.Routine(*place, match["name"].lower())
        elif match["end"]:
            yield st.RoutineEnd(*place)
        else:
            yield st.Flow(*place) if match["flow"] else st.Passive(*place)
    if text[at:].strip():
        yield st.Statement(lines.number(at), at, text[at:].strip())


def _statement(code: str, start: int, lines: st.Lines) -> st.Statement:
    said = code.strip()
    place = lines.number(start), start, said
    if (match := _DECLARED.search(code)) or (not _MOVE.search(code) and (match := _ASSIGNED.search(code))):
        value, at = match["value"].rstrip(), start + match.start("value")
        line = lines.number(at if match["kind"] else start + match.start("name"))
        name, kind = match["name"].lower(), match["kind"].lower()
        return st.Assignment(line, start, said, kind, name, match["part"] or "", value, at)
    if match := _MOVE.search(code):
        line = lines.number(start + match.start("word"))
        arguments = tuple(_arguments(match["rest"], start + match.start("rest")))
        return RapidMove(line, start, said, match["word"].lower(), arguments)
    if match := re.fullmatch(r"WaitTime (\S+)", said):
        return st.Waiting(*place, match[1])
    if said.startswith("PulseDO "):
        return st.Pulse(*place)
    if _PASSIVE.fullmatch(said):
        return st.Passive(*place)
    match = re.fullmatch(r"(\w+)(?:\s+[^\s:].*)?", said, re.DOTALL)
    return st.Statement(*place) if match is None else st.Call(*place, match[1].lower())


def _arguments(text: str, start: int) -> Iterator[Argument]:
    """Yield the arguments of a call, cut at the commas outside of brackets."""
    depth, at = 0, 0
    for k, char in enumerate(text + ","):
        depth += (char in "[({") - (char in "])}")
        if char == "," and (depth == 0 or k == len(text)):
            cell = text[at:k]
            if not cell.strip().startswith("\\"):
                yield Argument(cell.strip(), start + at + len(cell) - len(cell.lstrip()))
            at = k + 1


class RapidExecution(Execution, family="rapid"):
    """Every MoveAbsJ says its own speed and zone; nothing is remembered."""

    parse_file = staticmethod(parse)

    def order(self, statements: Sequence[st.Statement]) -> Iterator[st.Statement]:
        """Yield the statements from PROC main on."""
        return st.run_order(statements, "main")

    def execute(self, statement: st.Statement) -> bool:
        """Process a move; motions other than joint moves raise InputError."""
        if not isinstance(statement, RapidMove):
            return False
        self.move(*(_circle(statement) if statement.word == "movec" else _joint_move(statement)))
        return True


def _joint_move(move: RapidMove) -> tuple[list[float], float | None, float]:
    """Return angles [deg], the distance of the zone (None for an exact stop), and the speed."""
    if not move.text.startswith("MoveAbsJ") or len(move.arguments) != 4:
        raise _refusal(move)
    target, *how = (argument.text for argument in move.arguments)
    return _target_angles(move, target), *_manner(move, *how)


def _circle(move: RapidMove) -> tuple[list[float], float | None, float, list[float]]:
    """Return the same of a circle, and the angles of its middle; the controller works out both places for its tool."""
    if not move.text.startswith("MoveC") or len(move.arguments) != 5:
        raise _refusal(move)
    via, end, *how = (argument.text for argument in move.arguments)
    places = [re.fullmatch(rf"CalcRobT\((.*\]\]), {re.escape(how[-1])}\)", place) for place in (via, end)]
    targets = [_target_angles(move, "" if p is None else p[1]) for p in places]
    return targets[1], *_manner(move, *how), targets[0]


def _refusal(move: RapidMove) -> InputError:
    return InputError(f"'{move.text}' is no joint move of this family")


def _target_angles(move: RapidMove, target: str) -> list[float]:
    if not JOINT_TARGET.fullmatch(target):
        raise _refusal(move)
    numbers = st.placed_numbers(target, 0, st.EXPONENT_NUMBER)
    used = [*numbers[:6], *(n for n in numbers[6:] if n.value < UNUSED_AXIS)]
    return [st.parse_fixed_point(n.text, move.text) for n in used]


def _manner(move: RapidMove, speed: str, zone: str, tool: str) -> tuple[float | None, float]:
    """Return the distance of the zone (None for an exact stop), and the speed."""
    speeds, zones = re.fullmatch(r"\[([^],]*),[^]]*\]", speed), re.fullmatch(r"fine|\[FALSE,([^],]*),[^]]*\]", zone)
    if not (speeds and zones and re.fullmatch(r"\w+( \\WObj:=\w+)?", tool)):
        raise _refusal(move)
    return None if zones[1] is None else st.parse_fixed_point(zones[1], move.text), st.parse_fixed_point(
        speeds[1], move.text
    )
