"""Kawasaki AS: programs between ``.PROGRAM`` and ``.END``, positions in the blocks ``.JOINTS`` and ``.TRANS``.

Sources: AS language reference manual (D controller, 902091017DEB); files as SAVE writes them, such as those of the
public repository nguyen1024/rs005la. O, A, T are Euler angles, R = Rz(O) Ry(A) Rz(T) (Roboception, rc_visard manual,
"Kawasaki XYZ-OAT format"). A pose says no shape of the arm: it stays, until RIGHTY, LEFTY, ABOVE, BELOW, UWRIST or
DWRIST changes it.
"""

import re
from collections.abc import Iterator

import planner.programs.languages.declared as said
import planner.programs.languages.statements as st

_NAME = r"#?[A-Za-z][\w.]*(?:\[\d+(?:,\d+)*\])?"
_BLOCK = re.compile(r"\.(JOINTS|TRANS|REALS|STRINGS|INTEGER|SYSDATA|AUXDATA|ROBOTDATA\w*)\b.*", re.IGNORECASE)
_PROGRAM = re.compile(r"\.PROGRAM\s+([\w.]+)\s*\(.*", re.IGNORECASE)
_LABEL = re.compile(r"(?:\d+\s+|\w+:(?!=)\s*)(?=\S)")
_MOVE = re.compile(rf"(?P<word>JMOVE|LMOVE|HMOVE|C[12]MOVE)\s+(?P<name>{_NAME})\s*(?P<rest>,\s*\d+)?", re.IGNORECASE)
_PPOINT = re.compile(r"(?P<word>JMOVE|LMOVE)\s+#PPOINT\s*\((?P<numbers>[^()]*)\)", re.IGNORECASE)
_TAUGHT = re.compile(r"(?P<word>JOINT|LINEAR)\s+SPEED.*\bTOOL(?P<tool>\d+).*#\[(?P<numbers>[^\]]*)\].*", re.IGNORECASE)
_MOTION = re.compile(
    r"(?:\w*MOVE|\w*APPRO|\w*DEPART|DRAW|TDRAW|DRIVE|HOME2?|ALIGN|JOINT|LINEAR|CIR[12])\b(?!\s*=).*", re.IGNORECASE
)
_FLOW = re.compile(
    r"(?:IF|ELSE|END|FOR|WHILE|DO|UNTIL|CASE|VALUE|ANY|SVALUE|GOTO|RETURN\w*|ONI?"
    r"|RIGHTY|LEFTY|ABOVE|BELOW|UWRIST|DWRIST)\b(?!\s*=).*",
    re.IGNORECASE,
)
_FRAME = re.compile(rf"(?P<kind>TOOL|BASE)\s+(?P<name>NULL|{_NAME})", re.IGNORECASE)


def _entry(place: tuple[int, int, str], block: str) -> st.Statement:
    """Return one line of a block; a position of joints begins with ``#``."""
    found = re.fullmatch(rf"(?P<name>{_NAME})\s+(?P<numbers>.*)", place[2])
    if found is None or block not in ("JOINTS", "TRANS"):
        return st.Statement(*place)
    cells, start = found["numbers"], place[1] + found.start("numbers")
    numbers = said.numbers_in(cells, start, len(re.findall(r"[^\s,]+", cells)))
    why = "" if numbers else "has no plain numbers"
    if block == "JOINTS":
        return said.Position(*place, found["name"].lower(), joints=numbers, why_not=why)
    external = any(n.value for n in numbers[6:])
    why = "has external axes that are not at zero" if external else why
    return said.Position(*place, found["name"].lower(), pose=numbers[:6], why_not=why)


def _inline(place: tuple[int, int, str], found: re.Match[str]) -> said.Move:
    cells, start = found["numbers"], place[1] + found.start("numbers")
    numbers = said.numbers_in(cells, start, len(cells.split(",")))
    tool = found.groupdict().get("tool")
    own = said.Position(*place, place[2], joints=numbers)
    straight = found["word"].upper() not in ("JMOVE", "JOINT")
    return said.Move(*place, found["word"], inline=own, straight=straight, words="next", tool=tool and f"TOOL{tool}")


def _instruction(place: tuple[int, int, str]) -> st.Statement:
    text = place[2]
    if found := _PPOINT.fullmatch(text) or _TAUGHT.fullmatch(text):
        return _inline(place, found)
    if found := _MOVE.fullmatch(text):
        straight = found["word"].upper() != "JMOVE"
        return said.Move(*place, found["word"], (found["name"].lower(),), straight=straight, words="next")
    if _MOTION.fullmatch(text):
        return st.MotionStatement(*place, text.split()[0])
    if found := _FRAME.fullmatch(text):
        name = "" if found["name"].upper() == "NULL" else found["name"].lower()
        is_tool = found["kind"].upper() == "TOOL"
        return said.FrameChange(*place, tool=name if is_tool else None, base=None if is_tool else name)
    if found := re.fullmatch(rf"(SPEED|ACCURACY)\s+({st.NUMBER})", text):
        value = float(found[2])
        speed, distance = (value, None) if found[1] == "SPEED" else (None, value)
        return said.Words(*place, "next", speed=speed, rounded=True, distance=distance)
    if found := re.fullmatch(r"TWAIT (\S+)", text):
        return st.Waiting(*place, found[1])
    if re.fullmatch(r"PULSE \d+,0\.1", text):
        return st.Pulse(*place)
    if found := re.fullmatch(r"CALL\s+([\w.]+)\s*(?:\(.*\))?", text, re.IGNORECASE):
        return st.Call(*place, found[1].lower())
    return (st.Flow if _FLOW.fullmatch(text) else st.Statement)(*place)


def parse(text: str) -> Iterator[st.Statement]:
    """Yield the statements of every block; remarks and quoted texts are blank."""
    block = ""
    for line, start, row in st.Lines.of(st.mask_comments(text, r";[^\r\n]*")):
        code = row.strip()
        place = line, start + len(row) - len(row.lstrip()), code
        if not code or code.startswith((".*", ".NETCONF")):
            continue
        if found := _PROGRAM.fullmatch(code):
            block = "PROGRAM"
            yield st.Routine(*place, found[1].lower())
        elif found := _BLOCK.fullmatch(code):
            block = found[1].upper()
            yield st.Statement(*place)
        elif code.upper() == ".END":
            yield st.RoutineEnd(*place) if block == "PROGRAM" else st.Statement(*place)
            block = ""
        elif block == "PROGRAM":
            label = _LABEL.match(code)
            skip = label.end() if label else 0
            yield _instruction((line, place[1] + skip, code[skip:]))
        else:
            yield _entry(place, block)


class AsExecution(said.DeclaredExecution, family="as"):
    """Speed and accuracy hold for the next motion; BREAK makes an exact stop of the one before."""

    parse_file = staticmethod(parse)
    rotation = "ZYZ"
    any_case = True
    shifts = r"(?:X?ALTER|UTRACK|CVTRACK|SFTON)\b"
    stop = "BREAK"

    def rounding(self, move: said.Move) -> float | None:
        """Return the accuracy of the next motion; none said is that of the controller, which nobody knows here."""
        words = self.words.get(move.words)
        return words.distance if words is not None else None

    def execute(self, statement: st.Statement) -> bool:
        """Process a statement; a move uses the words up."""
        done = super().execute(statement)
        if isinstance(statement, said.Move):
            self.words = {}
        return done
