"""Stäubli VAL3 of s7 and s8: a program's code (.pgx), and the application's data (.dtx) with positions and speeds.

Sources: VAL3 reference manual (D28062804A: mdesc type, movej, movel, waitEndMove); programs and data as the public post
processors of RoboDK (Staubli VAL3 S7) and of Robots (visose/Robots, VAL3PostProcessor) write them. Both say the angles
as R = Rx(rx) Ry(ry) Rz(rz). The manual shows lefty, epositive and wpositive in pictures: they are not taken for known.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass

import planner.programs.languages.declared as said
import planner.programs.languages.statements as st
from planner.common.errors import InputError

_REMARKS = re.compile(r'(?P<kept>"[^"\r\n]*")|<!--(?:(?!-->).)*+(?:-->|(?P<unfinished>))|//[^\r\n]*', re.DOTALL)
_TAG = re.compile(r"\s*(?P<tag><!\[CDATA\[|\]\]>|<[/?\w][^<>]*>)")
_CODE_ENDS = re.compile(r"\]\]>|</code>|$", re.IGNORECASE)
_ATTRIBUTE = re.compile(r'(?<![\w:])([\w:]++)="([^"]*+)"')
_NAME = r"[A-Za-z]\w*(?:\[[^\[\]]*\])?"
_REST = re.compile(r"\s*+\S")
_MOVE = re.compile(rf"(?:\w+\s*=\s*)?(?P<word>move[jlc])\s*\((?P<names>\s*{_NAME}\s*(?:,\s*{_NAME}\s*){{2,3}})\)")
_MOTION = re.compile(r"(?:\w+\s*=\s*)?(?:move[jlc]|align\w*|movef)\s*\(.*")
_SPEED = re.compile(rf"(?P<name>{_NAME})\.(?P<key>vel|blend|leave|reach)\s*=\s*(?P<value>\S+)")
_FLOW = re.compile(
    r"(?:if|elseIf|else|endIf|for|endFor|while|endWhile|do|until|switch|case|default|break|endCase|endSwitch|return)\b.*"
)
_POSE = ("x", "y", "z", "rx", "ry", "rz")
_SHAPE = ("shoulder", "elbow", "wrist")
_OLD = re.compile(r'<(?:joint|point)(?:Rs)? name="(\w+)"')  # of data that s6 and older write


def _element(name: str) -> str:
    """Return the name of an element of a variable; without an index it is the first."""
    return name if "[" in name else f"{name}[0]"


@dataclass
class _Data:
    """The variable whose values come."""

    name: str = ""
    kind: str = ""

    def statement(self, place: tuple[int, int, str]) -> Iterator[st.Statement]:
        """Yield what one tag says."""
        tag, found = place[2], {m[1]: m for m in _ATTRIBUTE.finditer(place[2])}
        words = {key: match[2] for key, match in found.items()}
        if tag.startswith("<Data "):
            self.name, self.kind = words.get("name", ""), words.get("type", "").removesuffix("Rx").removesuffix("Rs")
        if old := _OLD.match(tag):
            yield said.Position(
                *place, f"{old[1]}[0]", why_not="stands in data of VAL3 s6, read are those of s7 and s8"
            )
        elif tag.startswith(("<Program ", "</Program>")):
            yield st.Routine(*place, words["name"]) if "name" in words else st.RoutineEnd(*place)
        elif not tag.startswith("<Value "):
            yield st.Passive(*place)
        else:
            numbers = {
                key: st.PlacedNumber(float(match[2]), match[2], place[1] + match.start(2))
                for key, match in found.items()
                if re.fullmatch(st.NUMBER, match[2])
            }
            yield from self._value(place, f"{self.name}[{words.get('key', '')}]", words, numbers)

    def _value(
        self, place: tuple[int, int, str], name: str, words: dict[str, str], numbers: dict[str, st.PlacedNumber]
    ) -> Iterator[st.Statement]:
        father = words.get("fatherId", "")
        pose = tuple(numbers[key] for key in _POSE if key in numbers)
        if self.kind == "joint":
            axes = sorted((key for key in words if re.fullmatch(r"j\d", key)), key=lambda key: key[1:])
            whole = axes == [f"j{k + 1}" for k in range(len(axes))] and all(key in numbers for key in axes)
            joints = tuple(numbers[key] for key in axes) if whole else ()
            yield said.Position(*place, name, joints=joints, why_not="" if joints else "does not say all its angles")
        elif self.kind == "point":
            shape = " ".join(words.get(key, key) for key in _SHAPE)
            kept = None if shape == "ssame esame wsame" else said.ArmShape(unknown=shape)
            why = "" if len(pose) == 6 and father else "does not say all its numbers and its frame"
            base = "" if father == "world[0]" else father
            yield said.Position(*place, name, pose=pose, shape=kept, base=base, why_not=why)
        elif self.kind in ("tool", "frame"):
            own = father == ("flange[0]" if self.kind == "tool" else "world[0]")
            why = "" if own and len(pose) == 6 else f"stands on {father or 'what it does not say'}, or lacks numbers"
            yield said.Frame(*place, name, () if why else pose, why)
        else:
            yield st.Statement(*place)


def _instruction(place: tuple[int, int, str]) -> Iterator[st.Statement]:
    text = place[2]
    if found := _MOVE.fullmatch(text):
        *targets, tool, how = (_element(name.strip()) for name in found["names"].split(","))
        straight, frame = found["word"] != "movej", "" if tool == "flange[0]" else tool
        if len(targets) == 1 + (found["word"] == "movec"):
            yield said.Move(*place, found["word"], tuple(targets), straight=straight, words=how, tool=frame)
            return
    if _MOTION.fullmatch(text):
        yield st.MotionStatement(*place, text.partition("(")[0])
    elif found := _SPEED.fullmatch(text):
        name, key, value = _element(found["name"]), found["key"], found["value"]
        number = float(value) if re.fullmatch(st.NUMBER, value) else None
        if key == "blend" and value in ("off", "joint", "Cartesian"):
            yield said.Words(*place, name, rounded=value != "off")
        elif key == "blend" or number is None:
            yield st.Statement(*place)
        elif key == "vel":
            yield said.Words(*place, name, speed=number)
        else:
            yield said.Words(*place, f"{name} reach" if key == "reach" else name, distance=number)
    elif found := re.fullmatch(r"delay\((\S+)\)", text):
        yield st.Waiting(*place, found[1])
    elif found := re.fullmatch(r"call\s+(\w+)\s*\(.*\)", text):
        yield st.Call(*place, found[1])
    else:
        yield (st.Flow if _FLOW.fullmatch(text) else st.Statement)(*place)


def _blank(remark: re.Match[str]) -> str:
    """Return a remark as blanks, its line ends kept; one that does not end stays, and so does a text in quotes."""
    stays = remark["kept"] is not None or remark["unfinished"] is not None
    return remark[0] if stays else re.sub(r"[^\r\n]", " ", remark[0])


def parse(text: str) -> Iterator[st.Statement]:
    """Yield the statements of a program or of data; remarks are blank, and texts in quotes are empty."""
    data, pulse = _Data(), False
    masked = _REMARKS.sub(_blank, text)
    for line, start, row in st.Lines.of(masked):
        at = 0
        while _REST.match(row, at):
            if found := _TAG.match(row, at):
                yield from data.statement((line, start + found.start("tag"), found["tag"]))
                at = found.end()
                continue
            end = _CODE_ENDS.search(row, at)
            code = row[at : end.start() if end else len(row)]
            place = line, start + at + len(code) - len(code.lstrip()), re.sub(r'"[^"]*"', '""', code.strip())
            at += len(code)
            for statement in _instruction(place):
                if found := re.fullmatch(r"dSync=(true|false|!dSync)", statement.text):
                    pulse = found[1] == "true"
                    yield statement if found[1] == "false" else st.Pulse(*place)
                else:  # a dwell inside a pulse is none of the program's
                    yield st.Passive(*place) if pulse and isinstance(statement, st.Waiting) else statement


class Val3Execution(said.DeclaredExecution, family="val3"):
    """A move takes speed and corner of its mdesc; the program runs ahead of the arm until waitEndMove."""

    parse_file = staticmethod(parse)
    rotation = "XYZ"
    stop = "waitEndMove()"
    name_letter = r"\w"

    def rounding(self, move: said.Move) -> float | None:
        """Return where a corner begins, leave, which is where it ends, reach."""
        words, reach = self.words.get(move.words), self.words.get(f"{move.words} reach")
        if words is None or not words.rounded:
            return None
        if reach is None or reach.distance != words.distance:
            raise InputError(f"line {move.line}: '{move.text}' has a corner whose leave and reach differ")
        return words.distance
