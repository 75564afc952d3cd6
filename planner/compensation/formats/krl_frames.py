"""Which tool and base hold at a statement of a KRL program, as far as its files say it for certain."""

import re
from collections.abc import Sequence

import numpy as np

import planner.programs.languages.statements as st
from planner.common.units import DEG, MM, Array, read_only
from planner.compensation.formats.krl_calls import (
    RESETS_FRAMES,
    SET_BESIDE,
    FrameChanges,
    calls_function,
    leaves_frames,
    names_given_away,
)
from planner.compensation.points import Frame, FramePair, trace_sources
from planner.compensation.rotations import frame, from_abc
from planner.compensation.targets import ToolAndBase
from planner.programs.languages.krl import POSE_KEYS, Aggregate, Bas, aggregate, parse

_TABLE = re.compile(r"(TOOL|BASE)_DATA\[\s*(\w+)\s*\]")
_STATE = {"TOOL": 0, "BASE": 1}
_EVERYWHERE = ("$ROBROOT", "$WORLD")
_FIXED_BASE = "#BASE"
_FDAT = re.compile(r"FDAT_ACT|F\w+")
_MAKERS_OWN = re.compile(r"IR_STOPM|[AH]\d\d")  # routines of interrupts that inline forms declare


def transform(found: Aggregate | None) -> Array | None:
    """Return the transform (4, 4) [m] of a value with X, Y, Z, A, B, C, else None."""
    numbers = {} if found is None else found.numbers or {}
    if not set(POSE_KEYS) <= numbers.keys():
        return None
    values = np.array([numbers[key].value for key in POSE_KEYS])
    return read_only(frame(values[None, :3] * MM, from_abc(values[None, 3:] * DEG))[0])


def _plain(value: str) -> Array | None:
    if value.upper() == "$NULLFRAME":
        return np.eye(4)
    return transform(aggregate(value, 0)) if value.startswith("{") and value.endswith("}") else None


class FrameState:
    """Tool and base as they stand at a statement, or why the files do not say them for certain."""

    def __init__(self, statements: Sequence[st.Statement], given: ToolAndBase) -> None:
        self._given = given.T_FT, given.T_WB
        self._values: dict[str, Frame] = {"TOOL_DATA[0]": np.eye(4), "BASE_DATA[0]": np.eye(4)}
        self._set_by_code = dict[str, int]()  # line of each frame that has its value only while the program runs
        self._everywhere = ""
        self._on_tool = _stationary_tool(statements)
        self._changes = FrameChanges(statements)
        own = [s for s in statements if isinstance(s, st.Assignment)]
        for statement in (*(s for s in parse(given.data) if isinstance(s, st.Assignment)), *own):
            self._take_value(statement)
        self._take_doubts(statements)
        self._changed = {s.name: _describe_change(s) for s in own if s.part and _FDAT.fullmatch(s.name)}
        self._taught = {s.name[1:]: s.value.upper() for s in own if s.kind == "FDAT" and s.name.startswith("F")}
        self.begin_routine()

    def _take_value(self, statement: st.Assignment) -> None:
        """Take in a frame that has a name; one that changes has no certain value anywhere."""
        name = re.sub(r"\s", "", statement.name)
        T = None if statement.part else _plain(statement.value)
        if name in _EVERYWHERE and (T is None or not np.allclose(T, np.eye(4))):
            self._everywhere = f"{_variable(statement)} is set in line {statement.line}"
        elif name.startswith("$") or (T is None and name not in self._values and not _TABLE.fullmatch(name)):
            return
        elif (table := _TABLE.fullmatch(name)) and not table[2].isdigit():
            for index in range(1, 129):
                self._values[f"{table[1]}_DATA[{index}]"] = _describe_change(statement)
        elif T is None or not np.array_equal(T, self._values.get(name, T)):
            self._values[name] = _describe_change(statement)
        else:
            if not self._changes.is_in_routine(statement):
                self._set_by_code.pop(name, None)
            elif name not in self._values:
                self._set_by_code[name] = statement.line
            self._values[name] = T

    def _take_doubts(self, statements: Sequence[st.Statement]) -> None:
        """Take in frames of a row that is written at a computed place, and those that a routine is given."""
        for s in statements:
            row, _, place = re.sub(r"\s", "", s.name).partition("[") if isinstance(s, st.Assignment) else ("", "", "")
            computed = place and not place[:-1].isdigit()
            given = names_given_away(s)
            for name in self._values:
                if (computed and name.startswith(f"{row}[")) or name in given:
                    self._values[name] = f"{name} may be changed in line {s.line} while the program runs"

    def begin_routine(self, routine: st.Statement | None = None) -> None:
        """Forget all: who calls may have set anything, and hands over what has the names of parameters."""
        self._shadowed = set(re.findall(r"\w+", routine.text.upper().partition("(")[2])) if routine else set[str]()
        self._variables = set[str]()  # of the routine's own: without a value they stop the program
        self._depth = 0
        self._inside: set[str] = set()  # what was set in IF or a loop that has not ended
        self.forget()

    def forget(self, because: str = "") -> None:
        """Forget what was set: another program may have set something else."""
        self._now: dict[str, Frame] = {"TOOL": because, "BASE": because, "IPO_MODE": ""}

    def now(self) -> FramePair:
        """Return tool and base at this statement."""
        if self._everywhere or (self._on_tool and self._now["IPO_MODE"] != _FIXED_BASE):
            return (self._everywhere or self._on_tool,) * 2
        return self._or_given(self._now["TOOL"], self._now["BASE"])

    def default_frames(self) -> FramePair:
        """Return tool and base of a point that no move of the file uses."""
        why = self._everywhere or self._on_tool
        return (why, why) if why else self._or_given("", "")

    def _or_given(self, tool: Frame, base: Frame) -> FramePair:
        pair = [
            given if given is not None and isinstance(f, str) and not f else f
            for given, f in zip(self._given, (tool, base), strict=True)
        ]
        return pair[0], pair[1]

    def of_point(self, name: str) -> FramePair | None:
        """Return tool and base of a point taught by inline form: XP1 goes with FP1; None where it has no FDAT."""
        data = self._taught.get(name[1:]) if name.startswith("X") else None
        if data is None:
            return None
        numbers = dict(re.findall(r"\b(TOOL|BASE)_NO\s+(-?\d+)", data))
        if re.search(r"IPO_FRAME\s+#TCP", data):
            return ("its tool stands still and the robot carries the part",) * 2
        if why := self._changed.get("FDAT_ACT") or self._changed.get(f"F{name[1:]}"):
            return why, why
        if self._everywhere or len(numbers) != 2:
            return (self._everywhere,) * 2
        return self._or_given(*(self._find_frame(f"{which}_DATA[{numbers[which]}]") for which in _STATE))

    def _find_frame(self, name: str) -> Frame:
        """Return a frame by its name as it is at this statement."""
        T, line = self._values.get(name, ""), self._set_by_code.get(name)
        everywhere = line is None or name in self._variables or isinstance(T, str)
        if everywhere or isinstance(self._now.get(name), np.ndarray):
            return T
        return f"{name} has its value only after line {line}, where that is run"

    def branch(self, flow: st.Flow) -> None:
        """Take in a branch, a loop or a label: what was set in one of them is not certain after it, nor in the next."""
        if id(flow) in self._changes.loops or flow.text.endswith(":"):
            self.forget()
        if flow.depth <= 0:
            self._now |= dict.fromkeys(self._inside, "")
        self._depth += flow.depth
        if self._depth <= 0:
            self._inside.clear()

    def take_aside(self, statement: st.Statement) -> str:
        """Take in a statement that neither moves nor assigns: it may set frames, call a function, declare an interrupt.

        Returns:
            The routine of an interrupt that is not in the file and not of KUKA's own, or nothing.
        """
        if SET_BESIDE.search(statement.text):
            self.forget(f"line {statement.line} sets it")
        elif routine := self._changes.interrupt(statement):
            if self._changes.is_harmless(routine):
                return ""
            if routine not in self._changes.routines:
                return "" if _MAKERS_OWN.fullmatch(routine) else routine
            self._everywhere = f"the interrupt of line {statement.line} may set another ({routine})"
        elif not leaves_frames(statement):
            self.forget(f"what line {statement.line} does is not known: '{statement.text[:40]}'")
        elif calls_function(statement):
            self.forget()
        elif declared := re.fullmatch(r"DECL\s+\w+\s+([\w,\s]+)", statement.text, re.IGNORECASE):
            inside = {s.name for body in self._changes.routines.values() for s in body if isinstance(s, st.Assignment)}
            self._variables |= set(re.findall(r"\w+", declared[1].upper()))
            self._shadowed |= self._variables - inside
        return ""

    def may_write(self, statement: st.Statement) -> bool:
        """Tell whether a routine that the statement calls may change what it is given."""
        return self._changes.may_write(statement)

    def take_trigger(self, call: st.Call) -> None:
        """Take in that a routine is run while the next move is driven."""
        if not self._changes.is_harmless(call.name):
            self.forget(f"the routine {call.name} of line {call.line} may set another")

    def select(self, statement: Bas) -> None:
        """Take in a call of BAS that selects frames by number, or forgets them."""
        if statement.what in _STATE:
            index = statement.value
            known = self._find_frame(f"{statement.what}_DATA[{int(index)}]") if index.isdigit() else ""
            self._set(statement.what, known)
        elif statement.what in RESETS_FRAMES:
            for which in self._now:
                self._set(which, "")

    def assign(self, statement: st.Assignment) -> None:
        """Take in what is given to ``$TOOL``, ``$BASE`` or ``$IPO_MODE``."""
        if statement.name == "$IPO_MODE":
            self._set("IPO_MODE", statement.value.upper())
            return
        T: Frame | None = None if statement.part else _plain(statement.value)
        if T is None and not statement.part:
            name = re.sub(r"\s", "", statement.value).upper()
            T = None if name in self._shadowed or name not in self._values else self._find_frame(name)
        self._set(statement.name[1:], _describe_change(statement) if T is None else T)

    def assign_named(self, statement: st.Assignment) -> None:
        """Take in that a frame with a name gets its value here."""
        name = re.sub(r"\s", "", statement.name)
        if name in self._set_by_code:
            self._set(name, self._values[name])

    def _set(self, which: str, T: Frame) -> None:
        self._now[which] = T
        if self._depth > 0:
            self._inside.add(which)


def _stationary_tool(statements: Sequence[st.Statement]) -> str:
    """Say where a file sets that the tool stands still and the robot carries the part; nothing where none does."""
    for s in statements:
        if isinstance(s, st.Assignment) and s.name == "$IPO_MODE" and s.value.upper() != _FIXED_BASE:
            return f"$IPO_MODE is {s.value} since line {s.line}"
        if re.search(r"IPO_FRAME\s*#TCP", s.text, re.IGNORECASE) or (isinstance(s, Bas) and s.what == "EX_TOOL"):
            return f"$IPO_MODE may be #TCP since line {s.line}"
    return ""


def _variable(statement: st.Assignment) -> str:
    return f"{statement.name}.{statement.part}" if statement.part else statement.name


def _describe_change(statement: st.Assignment) -> str:
    return f"{_variable(statement)} is changed in line {statement.line} while the program runs"


def frame_sources(statements: Sequence[st.Statement]) -> dict[str, int]:
    """Return the names of all that a tool or a base is made from, however many steps away, and a line each."""
    made = [
        (re.sub(r"\s", "", s.name), set(re.findall(r"(?<![\w.$#'])[A-Z_]\w*(?:\[[^\]]*\])?", s.value.upper())), s.line)
        for s in statements
        if isinstance(s, st.Assignment)
    ]
    begun = {name for name, _, _ in made if name in ("$TOOL", "$BASE", *_EVERYWHERE) or _TABLE.fullmatch(name)}
    return trace_sources(made, begun)
