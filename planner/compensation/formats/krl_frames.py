"""Which tool and base hold at a statement of a KRL program, as far as its files say it for certain."""

import re
from collections.abc import Sequence

import numpy as np

import planner.programs.languages.statements as st
from planner.compensation.formats.krl_calls import (
    RESETS_FRAMES,
    SELECTS_TAUGHT,
    SET_BESIDE,
    FrameChanges,
    calls_function,
    leaves_frames,
)
from planner.compensation.formats.krl_values import KINDS, TABLE, FrameValues, describe_change, frame_value, spell_name
from planner.compensation.points import Frame, FramePair, trace_sources
from planner.compensation.targets import ToolAndBase
from planner.programs.languages.krl import Bas

# variables whose value a pose depends on
FOLLOWED = ("$TOOL", "$BASE", "$IPO_MODE", "$ORI_TYPE", "FDAT_ACT", "LDAT_ACT")
_FIXED_BASE, _VARIABLE = "#BASE", "#VAR"
_WITH_TAUGHT = re.compile(  # the frames of a point taught by inline form, as a spline move takes them
    r"\$(TOOL|BASE|IPO_MODE)\s*=\s*S(?:TOOL2|BASE|IPO_MODE)\s*\(\s*(F\w+)(?:\s*\.\s*\w+)?\s*\)", re.IGNORECASE
)


class FrameState:
    """Tool and base as they stand at a statement, or why the files do not say them for certain."""

    def __init__(self, statements: Sequence[st.Statement], given: ToolAndBase) -> None:
        self._changes = FrameChanges(statements)
        self._values = FrameValues(statements, self._changes, given)
        self._on_tool = _stationary_tool(statements)
        self._turns = _orientation(statements)
        self.begin_routine()

    def begin_routine(self, routine: st.Statement | None = None) -> None:
        """Forget all: who calls may have set anything, and hands over what has the names of parameters."""
        self._shadowed = set(re.findall(r"\w+", routine.text.upper().partition("(")[2])) if routine else set[str]()
        self._variables = set[str]()  # of the routine's own: without a value they stop the program
        self._depth = 0
        self._inside: set[str] = set()  # what was set in IF or a loop that has not ended
        self.forget()

    def forget(self, because: str = "") -> None:
        """Forget what was set: another program may have set something else."""
        self._now: dict[str, Frame] = dict.fromkeys((name.lstrip("$") for name in FOLLOWED), "")
        self._now |= {"TOOL": because, "BASE": because}

    def hides(self, name: str) -> bool:
        """Tell whether a name is a parameter or a variable of the routine, which hides that of the module."""
        return name in self._shadowed

    def current_frames(self) -> FramePair:
        """Return tool and base at this statement."""
        why = self._values.everywhere
        if self._on_tool and self._now["IPO_MODE"] != _FIXED_BASE:
            why = why or self._on_tool
        return (why, why) if why else self._with_given_frames(self._now["TOOL"], self._now["BASE"])

    def of_move(self, rest: str) -> FramePair:
        """Return tool and base of a spline move that says them for itself, as inline forms write it."""
        taught = _WITH_TAUGHT.findall(rest)
        said = re.findall(r"\$(TOOL|BASE|IPO_MODE|ROBROOT|WORLD)\b", rest, re.IGNORECASE)
        names = {name.upper() for _, name in taught}
        if len(taught) != len(said) or len({which.upper() for which, _ in taught}) != 3 or len(names) != 1:
            return ("its move says tool or base for itself, in a way that is not known",) * 2
        return self._of_fdat(self._values.resolve_fdat(names.pop()))

    def default_frames(self) -> FramePair:
        """Return tool and base of a point that no move of the file uses."""
        why = self._values.everywhere or self._on_tool
        return (why, why) if why else self._with_given_frames("", "")

    def _with_given_frames(self, tool: Frame, base: Frame) -> FramePair:
        pair = [
            given if given is not None and isinstance(f, str) and not f else f
            for given, f in zip(self._values.unsaid, (tool, base), strict=True)
        ]
        return pair[0], pair[1]

    def taught_frames(self, name: str) -> FramePair | None:
        """Return tool and base that a point was taught with by inline form; None where it has no FDAT."""
        fdat = self._values.taught_frame_data(name)
        return None if fdat is None else self._of_fdat(fdat)

    def _of_fdat(self, fdat: str) -> FramePair:
        names = self._values.everywhere or self._values.names_in(fdat)
        return (names, names) if isinstance(names, str) else (self._find_frame(names[0]), self._find_frame(names[1]))

    def doubt_orientation(self, rest: str) -> str:
        """Say why a straight move may keep its first orientation and not turn to its target's; empty if it turns."""
        named = re.search(r"\bSORI_TYP\s*\(\s*(\w+)", rest, re.IGNORECASE)
        mode = self._values.orientation_of(named[1]) if named else self._now["ORI_TYPE"]
        return "" if mode == _VARIABLE else self._turns or self._values.turned

    def _find_frame(self, name: str) -> Frame:
        """Return a frame by its name as it is at this statement."""
        T, line = self._values.find(name), self._values.set_by_code.get(name)
        everywhere = line is None or name in self._variables or isinstance(T, str)
        if everywhere or isinstance(self._now.get(name), np.ndarray):
            return T
        return f"{name} has its value only after line {line}, where that is run"

    def branch(self, flow: st.Flow) -> None:
        """Process a branch, a loop or a label: what was set in one of them is not certain after it, nor in the next."""
        if id(flow) in self._changes.loops or flow.text.endswith(":"):
            self.forget()
        if flow.depth <= 0:
            self._now |= dict.fromkeys(self._inside, "")
        self._depth += flow.depth
        if self._depth <= 0:
            self._inside.clear()

    def take_aside(self, statement: st.Statement) -> None:
        """Process a statement that neither moves nor assigns: it may set frames, or declare an interrupt that does."""
        if (doubt := self._changes.doubt_interrupt(statement)) is not None:
            if doubt:
                self._values.everywhere = f"the interrupt of line {statement.line} may set another ({doubt})"
        elif SET_BESIDE.search(statement.text):
            self.forget(f"line {statement.line} sets it")
        elif not leaves_frames(statement):
            self.forget(f"what line {statement.line} does is not known: '{statement.text[:40]}'")
        elif calls_function(statement):
            self.forget()
        elif declared := re.fullmatch(r"DECL\s+\w+\s+([\w,\s]+)", statement.text, re.IGNORECASE):
            names = set(re.findall(r"\w+", declared[1].upper()))
            self._variables |= names
            self._shadowed |= names - self._changes.assigned

    def may_write(self, statement: st.Statement) -> bool:
        """Tell whether a routine that the statement calls may change what it is given."""
        return self._changes.may_write(statement)

    def take_trigger(self, call: st.Call) -> None:
        """Note that a routine is run while the next move is driven."""
        if not self._changes.is_harmless(call.name):
            self.forget(f"the routine {call.name} of line {call.line} may set another")

    def select(self, statement: Bas) -> None:
        """Process a call of BAS that selects frames by number or as a point was taught, or forgets them."""
        if statement.what in KINDS:
            index = statement.value
            known = self._find_frame(f"{statement.what}_DATA[{int(index)}]") if index.isdigit() else ""
            self._set(statement.what, known)
        elif statement.what in SELECTS_TAUGHT:
            fdat = str(self._now["FDAT_ACT"])
            for which, found in zip(KINDS, self._of_fdat(fdat), strict=True):
                self._set(which, found)
            mode = re.search(r"IPO_FRAME\s+(#\w+)", fdat)
            self._set("IPO_MODE", mode[1] if mode else "")
            if statement.what == "CP_PARAMS":
                self._set("ORI_TYPE", self._values.orientation_of(str(self._now["LDAT_ACT"])))
        elif statement.what == "CP_DAT":
            self._set("ORI_TYPE", self._values.orientation_of(str(self._now["LDAT_ACT"])))
        elif statement.what in RESETS_FRAMES:
            for which in list(self._now):
                self._set(which, "")

    def assign(self, statement: st.Assignment) -> None:
        """Read what is given to one of the variables that are ``FOLLOWED``."""
        if calls_function(statement):
            self.forget()
        which = statement.name.lstrip("$")
        if which in KINDS:
            self._set(which, self._assigned_frame(statement))
        elif which == "FDAT_ACT":
            self._set(which, "" if statement.part else self._values.resolve_fdat(statement.value))
        elif which == "LDAT_ACT":
            self._set(which, "" if statement.part else statement.value)
        else:
            self._set(which, statement.value.upper())

    def _assigned_frame(self, statement: st.Assignment) -> Frame:
        """Return the frame that is given to $TOOL or $BASE, or why it is not certain."""
        T = None if statement.part else frame_value(statement.value, self._named_frame)
        return describe_change(statement) if T is None else T

    def _named_frame(self, name: str) -> Frame | None:
        """Return the frame of a name at this statement, or why it is not certain; None where there is none."""
        if name in ("$TOOL", "$BASE"):
            T = self._now[name[1:]]
            return None if isinstance(T, str) else T
        known = name in self._values or TABLE.fullmatch(name)
        return self._find_frame(name) if known and name not in self._shadowed else None

    def assign_named_frame(self, statement: st.Assignment) -> None:
        """Note that a frame with a name gets its value here."""
        name = spell_name(statement.name)
        if name in self._values.set_by_code:
            self._set(name, self._values.find(name))

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


def _orientation(statements: Sequence[st.Statement]) -> str:
    """Say where a file sets that straight moves keep their orientation; nothing where none does."""
    for s in statements:
        if isinstance(s, st.Assignment) and s.name == "$ORI_TYPE" and s.value.upper() != _VARIABLE:
            return f"$ORI_TYPE may be {s.value} since line {s.line}: the arm keeps the orientation that it comes with"
        if found := re.search(r"\bORI_TYP\s*(?:=(?!=)\s*(?!#VAR\b)|(?=#)(?!#VAR\b))([#$\w.]+)", s.text, re.IGNORECASE):
            return f"ORI_TYP is {found[1]} in line {s.line}: the arm may keep the orientation that it comes with"
    return ""


def frame_sources(statements: Sequence[st.Statement]) -> dict[str, int]:
    """Return the names of all variables that tools and bases are computed from, directly or not, each with a line."""
    made = [
        (spell_name(s.name), set(re.findall(r"(?<![\w.$#'])[A-Z_]\w*(?:\[[^\]]*\])?", s.value.upper())), s.line)
        for s in statements
        if isinstance(s, st.Assignment)
    ]
    ends = ("$TOOL", "$BASE", "$ROBROOT", "$WORLD")
    return trace_sources(made, {name for name, _, _ in made if name in ends or TABLE.fullmatch(name)})
