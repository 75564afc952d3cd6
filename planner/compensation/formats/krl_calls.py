"""What a KRL statement may change behind a reader's back: functions in expressions, routines, interrupts, loops."""

import re
from collections.abc import Sequence

import planner.programs.languages.statements as st
from planner.programs.languages.krl import POSE_KEYS, Bas

SELECTS_TAUGHT = ("PTP_PARAMS", "CP_PARAMS", "FRAMES")  # functions of BAS that take tool and base from FDAT_ACT
RESETS_FRAMES = ("INITMOV", "EX_BASE", "BASE_TCP", "TCP_IPO", "EX_TOOL")
SET_BESIDE = re.compile(r"\$(TOOL|BASE|IPO_MODE)\b[^=<>]*=(?!=)", re.IGNORECASE)
MORE_THAN_A_MOVE = re.compile(r"\bWITH\b.*\$ORI_TYPE\s*=\s*#(?!VAR\b)|[{}]|\b(S?PTP|S?LIN|S?CIRC|SPL)\b", re.IGNORECASE)
CIRCLE_ANGLE = re.compile(r"\s*,\s*CA\b", re.IGNORECASE)
OWN_FRAMES = re.compile(r"\bWITH\b.*\$(TOOL|BASE|IPO_MODE|ROBROOT|WORLD)\b", re.IGNORECASE)
_SET_FRAMES, _NUMBERED_FRAMES = ("$TOOL", "$BASE", "$IPO_MODE", "$ORI_TYPE", "FDAT_ACT"), ("TOOL", "BASE")
_BUILT_IN = (
    "SQRT|SIN|COS|TAN|ATAN2|ABS|ACOS|INV_POS|FORWARD|INVERSE|STRLEN|STRDECLLEN|VARSTATE|B_AND|B_OR|B_EXOR|B_NOT"
    "|S(?:VEL|ACC)_(?:JOINT|PTP|CP)|STOOL2?|SBASE|SIPO_MODE|SLOAD|SORI_TYP|SAPO(?:_PTP)?|S(?:GEAR_)?JERK|USE_CM_PRO_VALUES"
)
_KEYWORDS = "IF|WHILE|UNTIL|SWITCH|CASE|FOR|AND|OR|NOT|EXOR|TO|STEP|PULSE|SEC|DO|THEN|WAIT|RETURN"
_FUNCTION = re.compile(rf"(?<![.\w$])(?!(?:{_BUILT_IN}|{_KEYWORDS})\b)[A-Z_]\w*+\s*+\(", re.IGNORECASE)
_TYPES = "INT|REAL|BOOL|CHAR|FRAME|POS|E6POS|AXIS|E6AXIS"
_FRAMES = r"\$(?:TOOL|BASE|IPO_MODE|ROBROOT|WORLD)\b|(?:TOOL|BASE)_DATA\b"
_LEAVE_FRAMES = (  # statements that the parser yields as unknown, and that leave tool and base alone
    rf"(?:{_TYPES}|SIGNAL|EXT|EXTP|EXTFCT|EXTFCTP|ENUM|CHANNEL|IMPORT)\s+\S.*",
    r"(?:END)?(?:PTP_?)?SPLINE(?:\s+WITH\b(?!.*\$(?:TOOL|BASE|IPO_MODE|ORI_TYPE|ROBROOT|WORLD)\b).*)?|CONTINUE|BRAKE(\s+F)?|EXIT|RESUME|ON_ERROR_PROCEED",
    r"(?:RETURN|WAIT|STOP\s+WHEN|TIME_BLOCK|CONST_VEL|ASYPTP|ASYCONT|ASYSTOP|ANOUT|CWRITE|SWRITE)\b.*",
    rf"(?:TRIGGER\b.*\bDO\s+)?(?!{_FRAMES})\$?[A-Z_][\w$]*(?:\s*[.\[][^=]*)?=(?!=).*",
)
_LEAVES_FRAMES = re.compile("|".join(_LEAVE_FRAMES), re.IGNORECASE)
_SET = re.compile(r"(?<![\w.$#'])([A-Z_]\w*(?:\s*\[[^\]]*\])?)\s*(?:\.\s*\w+\s*)?(?<![<>=])=(?!=)")
_LOOP = re.compile(r"(LOOP|WHILE|FOR|REPEAT)\b", re.IGNORECASE)
_INTERRUPT = re.compile(
    r"(?:GLOBAL\s+)?INTERRUPT\b.*?\bDECL\b.*?\bDO\s+(?P<body>(?P<routine>\w+)\s*\(.*|.*)", re.IGNORECASE
)
_MAKERS_OWN = re.compile(r"IR_STOPM|[AH]\d\d|PULSE", re.IGNORECASE)  # what interrupts of inline forms run


def calls_function(statement: st.Statement) -> bool:
    """Tell whether a routine of somebody's own is called in an expression of the statement."""
    return _FUNCTION.search(statement.text) is not None


def leaves_frames(statement: st.Statement) -> bool:
    """Tell whether a statement is known to leave tool and base as they are, calls in it apart."""
    return type(statement) is not st.Statement or _LEAVES_FRAMES.fullmatch(statement.text) is not None


def names_set_beside(statement: st.Statement) -> set[str]:
    """Return the names, in capitals, that a trigger or an instruction sets on its way, rather than an assignment."""
    if isinstance(statement, st.Assignment | st.MotionStatement):
        return set()
    return {re.sub(r"\s", "", name) for name in _SET.findall(statement.text.upper())}


def names_given_away(statement: st.Statement) -> set[str]:
    """Return the variables, in capitals, that calls are given as arguments, and so may change."""
    if isinstance(statement, Bas | st.Routine) or not calls_function(statement):
        return set()
    given = statement.text.upper().partition("(")[2]
    return {re.sub(r"\s", "", name) for name in re.findall(r"(?<![\w.$#'])[A-Z_]\w*(?:\s*\[[^\]]*\])?", given)}


_MOVE_INSIDE = re.compile(r"(?<![#$\w.])S?(?:PTP|LIN|CIRC)(?:_REL)?(?:\s++|(?=\{))[{$A-Z_]|\bSPL\s*+\{", re.IGNORECASE)
_NUMBERED_KEY = re.compile(r"\b([A-Z]\w*+)\s++([-+]?[0-9.]++)")


def hidden_target(statement: st.Statement) -> str:
    """Return what in a statement, that is none of a move or a position with a name, is a target; or nothing.

    Values that are all zero are places that the program fills.
    """
    frame = isinstance(statement, st.Assignment)  # six plain components are then a frame, as far as it says
    for inside in re.findall(r"\{([^{}]*)\}", statement.text):
        found = dict(_NUMBERED_KEY.findall(inside.upper()))
        spelled = "A1" in found or {"X", "S", "T"} <= found.keys() or (not frame and set(POSE_KEYS) <= found.keys())
        if spelled and any(number.strip("-+0.") for number in found.values()):
            return f"{{{inside[:60]}}}"
    move = None if frame else _MOVE_INSIDE.search(statement.text)
    return statement.text[:60] if move else ""


def _routine_name(head: st.Routine) -> str:
    """Return the name, in capitals, of a routine or function, also of one that takes arguments."""
    name = re.search(r"(\w+)\s*\(", head.text)
    return head.name if name is None else name[1].upper()


class FrameChanges:
    """Which routines and loops of a file may leave another tool or base.

    Attributes:
        routines: statements of each routine, by name.
        loops: first statements, by id, of loops whose second pass may begin with other frames.
        assigned: names that the routines give a value.
    """

    def __init__(self, statements: Sequence[st.Statement]) -> None:
        self.routines: dict[str, list[st.Statement]] = {}
        here = list[st.Statement]()
        for s in statements:
            if isinstance(s, st.Routine):
                here = self.routines.setdefault(_routine_name(s), [])
            here.append(s)
            if isinstance(s, st.RoutineEnd):
                here = []
        inside = [s for body in self.routines.values() for s in body]
        self._inside = {id(s) for s in inside}
        self.assigned = {s.name for s in inside if isinstance(s, st.Assignment)}
        self._harmless: dict[tuple[str, bool], bool] = {}  # by routine, and whether its calls count
        self.loops = self._changing_loops(statements)

    def is_in_routine(self, statement: st.Statement) -> bool:
        """Tell whether a statement is run, rather than being data of the module."""
        return id(statement) in self._inside

    def doubt_interrupt(self, statement: st.Statement) -> str | None:
        """Say what an interrupt that is declared here may run that sets tool or base; empty if nothing.

        None where no interrupt is declared. A routine that is not in the file may set anything, as in a trigger.
        """
        match = _INTERRUPT.match(statement.text)
        if match is None:
            return None
        if match["routine"] is None:
            body = match["body"].strip()
            harmless = _LEAVES_FRAMES.fullmatch(body) is not None and SET_BESIDE.search(body) is None
            return "" if harmless else f"'{body[:40]}'"
        routine = match["routine"].upper()
        if self.is_harmless(routine) or (routine not in self.routines and _MAKERS_OWN.fullmatch(routine)):
            return ""
        return f"the routine {routine}" + ("" if routine in self.routines else ", which is not in the file")

    def may_write(self, statement: st.Statement) -> bool:
        """Tell whether a called routine is not in the file, or takes anything but values (``:IN``)."""
        called = {m[0].rstrip("( \t").upper() for m in _FUNCTION.finditer(statement.text)}
        return not all(name in self.routines and self._takes_values_alone(name) for name in called)

    def _takes_values_alone(self, routine: str) -> bool:
        parameters = self.routines[routine][0].text.upper().partition("(")[2]
        return all(re.findall(r"\w+\s*(?:\[[^\]]*\]\s*)?(:\s*IN\b)?\s*(?=[,)])", parameters))

    def is_harmless(self, routine: str) -> bool:
        """Tell whether a routine is in the file and leaves tool and base, and what it is given, as they are."""
        return self._is_harmless(routine, calls_count=True)

    def _is_harmless(self, routine: str, calls_count: bool) -> bool:
        key = routine, calls_count
        if key not in self._harmless:
            body = (s for s in self.routines.get(routine, ()) if calls_count or not isinstance(s, st.Call))
            known = routine in self.routines and self._takes_values_alone(routine)
            self._harmless[key] = known and not any(self._changes(s) for s in body)
        return self._harmless[key]

    def _changes(self, statement: st.Statement) -> bool:
        """Tell whether tool or base may be others after a statement."""
        match statement:
            case st.Assignment(name=name) if name in _SET_FRAMES:
                return True
            case Bas(what=what):
                return what in (*_NUMBERED_FRAMES, *SELECTS_TAUGHT, *RESETS_FRAMES)
            case st.Call(triggered=True, name=name):
                return not self._is_harmless(name, calls_count=False)
            case st.Call():
                return True
            case st.Routine() | st.RoutineEnd():
                return False
        declares = _INTERRUPT.match(statement.text) is not None
        leaves = leaves_frames(statement) and SET_BESIDE.search(statement.text) is None
        return not declares and (calls_function(statement) or not leaves)

    def _changing_loops(self, statements: Sequence[st.Statement]) -> set[int]:
        found, begun, looked = set[int](), list[st.Flow](), 0  # how many of those begun have been looked at
        for s in statements:
            if looked < len(begun) and self._changes(s):
                found |= {id(loop) for loop in begun[looked:] if _LOOP.match(loop.text)}
                looked = len(begun)
            if isinstance(s, st.Routine | st.RoutineEnd):
                begun.clear()
            elif isinstance(s, st.Flow) and s.depth > 0:
                begun.append(s)
            elif isinstance(s, st.Flow) and s.depth < 0 and begun:
                begun.pop()
            looked = min(looked, len(begun))
        return found
