"""Which tool and base stand in a KRL file: ``$TOOL``, ``$BASE``, ``BAS (#TOOL,n)``, and the FDAT of taught points."""

import re

import numpy as np

from planner.compensation.formats.krl_values import POSE_KEYS, entries, transform
from planner.compensation.targets import Reading
from planner.units import Array

_SET = re.compile(r"\s*\$(?P<which>TOOL|BASE)\s*=\s*(?P<value>.*)", re.IGNORECASE)
_BAS = re.compile(r"\s*BAS\s*\(\s*#(?P<what>\w+)\s*(?:,\s*(?P<value>[^)]*?)\s*)?\)", re.IGNORECASE)
_DATA = re.compile(r"(?P<table>TOOL|BASE)_DATA\[\s*(?P<index>\d+)\s*\]\s*=\s*(?P<value>\{[^}]*\})", re.IGNORECASE)
_FDAT = re.compile(r"\bFDAT\s+F(?P<name>\w+)\s*=\s*\{(?P<value>[^}]*)\}", re.IGNORECASE)
_OPENING = re.compile(r"\s*(IF|FOR|LOOP|WHILE|REPEAT|SWITCH)\b", re.IGNORECASE)
_CLOSING = re.compile(r"\s*(ENDIF|ENDFOR|ENDLOOP|ENDWHILE|UNTIL|ENDSWITCH)\b", re.IGNORECASE)
Frame = Array | None


class FrameState:
    """Tool and base as they stand at a line; None where the file does not say them for certain."""

    hint = (
        ": say it by $TOOL, $BASE, BAS (#TOOL,n), BAS (#BASE,n) before the move (outside of IF and loops), give the "
        "controller's $config.dat for numbered frames (--frames), or name them yourself (--tool, --base)"
    )

    def __init__(self, text: str, reading: Reading) -> None:
        self._reading = reading
        self._tables: dict[tuple[str, int], Array] = {("TOOL", 0): np.eye(4), ("BASE", 0): np.eye(4)}
        for source in (reading.frames.data, text):
            for match in _DATA.finditer(source):
                found = entries(match["value"], 0)
                if found is not None and set(POSE_KEYS) <= found.keys():
                    self._tables[match["table"].upper(), int(match["index"])] = transform(found)
        self._points = {m["name"].upper(): m["value"].upper() for m in _FDAT.finditer(text)}
        self._now: dict[str, Frame] = {"TOOL": None, "BASE": None}
        self._depth = 0
        self._doubtful = False

    def given(self) -> tuple[Frame, Frame]:
        """Return tool and base that the person has named."""
        return self._reading.frames.T_FT, self._reading.frames.T_WB

    def now(self) -> tuple[Frame, Frame]:
        """Return tool and base at this line."""
        T_FT, T_WB = self.given()
        if self._doubtful:
            return T_FT, T_WB
        tool, base = self._now["TOOL"], self._now["BASE"]
        return T_FT if tool is None else tool, T_WB if base is None else base

    def of_point(self, name: str) -> tuple[Frame, Frame] | None:
        """Return tool and base of a point taught by inline form: XP1 goes with FP1; None where it has no FDAT."""
        data = self._points.get(name[1:]) if name.startswith("X") else None
        if data is None:
            return None
        numbers = dict(re.findall(r"\b(TOOL|BASE)_NO\s+(-?\d+)", data))
        if re.search(r"IPO_FRAME\s+#TCP", data) or len(numbers) != 2:
            return None, None
        T_FT, T_WB = self.given()
        tool, base = (self._tables.get((w, int(numbers[w]))) for w in ("TOOL", "BASE"))
        return T_FT if tool is None else tool, T_WB if base is None else base

    def forget(self) -> None:
        """Forget what was set: another program may have set something else."""
        self._now = {"TOOL": None, "BASE": None}
        self._depth, self._doubtful = 0, False

    def branch(self, line: str) -> None:
        """Count how deep in IF and loops the next line is."""
        self._depth += bool(_OPENING.match(line)) - bool(_CLOSING.match(line))

    def statement(self, number: int, place: int, line: str) -> bool:
        """Take in a line that sets a frame; return whether it was one."""
        if match := _SET.match(line):
            self._set(match["which"].upper(), self._value(match["value"].strip(), place))
            return True
        if match := _BAS.match(line):
            what = match["what"].upper()
            if what in ("TOOL", "BASE"):
                index = match["value"] or ""
                self._set(what, self._tables.get((what, int(index))) if index.isdigit() else None)
            elif what in ("INITMOV", "FRAMES", "EX_BASE", "BASE_TCP", "TCP_IPO", "EX_TOOL"):
                self._set("TOOL", None)
                self._set("BASE", None)
            return True
        return False

    def _set(self, which: str, value: Frame) -> None:
        self._now[which] = value
        self._doubtful |= self._depth > 0

    def _value(self, value: str, place: int) -> Frame:
        if value.upper() == "$NULLFRAME":
            return np.eye(4)
        if match := re.fullmatch(r"(TOOL|BASE)_DATA\[\s*(\d+)\s*\]", value, re.IGNORECASE):
            return self._tables.get((match[1].upper(), int(match[2])))
        found = entries(value, place) if value.startswith("{") and value.endswith("}") else None
        return transform(found) if found is not None and set(POSE_KEYS) <= found.keys() else None
