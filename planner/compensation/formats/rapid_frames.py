"""Tools and work objects of a RAPID file by the key of their declaration, and the scopes in which names are found.

How a RAPID program lets the tool turn on the way of a move, where it then ends otherwise than the target says.
"""

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

import planner.programs.languages.statements as st
from planner.common.units import MM, Array
from planner.compensation.points import Frame, FramePair, trace_sources
from planner.compensation.rotations import pose_matrix
from planner.compensation.targets import ToolAndBase
from planner.programs.languages.rapid import POSE, RapidMove

_MODULE = re.compile(r"(?<!END)\bMODULE\s+(\w+)", re.IGNORECASE)
_VALUELESS = re.compile(r"\b(?:VAR|PERS)\s+(?P<kind>\w+)\s+(?P<name>\w+)\s*(?:\{[^{}]*\})?\s*$", re.IGNORECASE)
_PARAMETERS = re.compile(r"\b(?:VAR\s+|PERS\s+|INOUT\s+)?(\w+)\s+(\w+)\s*(?:\{[^{}]*\})?\s*(?=[,)|\\])", re.IGNORECASE)


@dataclass(frozen=True)
class Placed:
    """A statement, and the module and the routine that it stands in, either of them empty.

    ``beside``: it is of a module that was given with the file.
    """

    statement: st.Statement
    module: str
    routine: str
    beside: bool = False

    @property
    def where(self) -> str:
        """The line of the statement, and its module where that is another."""
        return f"line {self.statement.line}" + (f" of module {self.module}" if self.beside else "")


def place(statements: Sequence[st.Statement], beside: bool = False) -> Iterator[Placed]:
    """Yield the statements with their scopes."""
    module = routine = ""
    for statement in statements:
        if match := _MODULE.search(statement.text):
            module, routine = match[1].lower(), ""
        if isinstance(statement, st.Routine):
            routine = statement.name
        yield Placed(statement, module, routine, beside)
        if isinstance(statement, st.RoutineEnd):
            routine = ""


class Names:
    """What the names of a file stand for: each declaration has a key of its own."""

    def __init__(self, placed: Sequence[Placed]) -> None:
        self._keys: set[str] = set()
        self._local: set[str] = set()  # seen in their own module alone
        self._variables: set[str] = set()  # declared without a value, to get it in the program
        for p in placed:
            keys = {_key(p.module, p.routine, name) for name in _declared_names(p.statement)}
            self._keys |= keys
            self._variables |= (
                keys if type(p.statement) is not st.Routine and _VALUELESS.search(p.statement.text) else set()
            )
            self._local |= keys if re.search(r"\bLOCAL\b", p.statement.text, re.IGNORECASE) else set()
        self._shared: dict[str, list[str]] = {}  # by name, the keys of what any module sees
        for key in sorted(self._keys - self._local):
            _, routine, name = key.rsplit(".", 2)
            if not routine:
                self._shared.setdefault(name, []).append(key)

    def key_of(self, p: Placed, name: str) -> str:
        """Return the key of ``name`` as it is declared in this statement."""
        return _key(p.module, p.routine, name)

    def declares(self, key: str) -> bool:
        """Tell whether a key is one of a declaration or a parameter in the files."""
        return key in self._keys

    def is_variable(self, key: str) -> bool:
        """Tell whether a key is one of data that are declared without a value."""
        return key in self._variables

    def resolve(self, p: Placed, name: str) -> str:
        """Return the key of ``name`` as it is used in this statement, or the bare name if the file does not have it."""
        name = name.lower()
        for key in (_key(p.module, p.routine, name), _key(p.module, "", name)):
            if key in self._keys:
                return key
        others = self._shared.get(name, ())
        return others[0] if len(others) == 1 else name


def _key(module: str, routine: str, name: str) -> str:
    return f"{module}.{routine}.{name.lower()}"


def _declared_names(statement: st.Statement) -> Iterator[str]:
    """Yield the names that a statement declares: data with or without a value, or parameters."""
    match statement:
        case st.Assignment(kind=kind, name=name) if kind:
            yield name
        case st.Routine(text=text):
            yield from (name for _, name in _PARAMETERS.findall(text.partition("(")[2]))
        case _ if match_ := _VALUELESS.search(statement.text):
            yield match_["name"]


# Routines of the controller that only read what they are handed, and words that may stand before a bracket.
_READERS = re.compile(
    r"return|offs|reltool|c(?:robt|pos|tool|wobj)|calc(?:robt|jointt)|pose(?:mult|inv|vect)|orientzyx|eulerzyx|norient"
    r"|defd?frame|distance|abs|sqrt|dim|valtostr|numtostr|ispers|isvar|tpwrite|write|waituntil|setsysdata"
    r"|arcmove(?:absj|j|l|c)",
    re.IGNORECASE,
)
_WORDS = re.compile(r"and|x?or|not|mod|div|(?:else)?if|while|for|from|to|step|until|test|case|", re.IGNORECASE)
_TOKEN = st.compile_possessive_spaces(
    r"(?P<open>(?:(?<![\w.\\])(?P<routine>[A-Za-z]\w*)\s*)?\()|(?P<close>\))"
    r"|(?<![\w.\\])(?P<name>[A-Za-z]\w*)(?P<part>(?:\{[^{}]*\})?\.)?",
    re.IGNORECASE,
)


def is_read_only(routine: str) -> bool:
    """Tell whether a word before a bracket is none of a routine that may write what it is handed."""
    return bool(_READERS.fullmatch(routine) or _WORDS.fullmatch(routine))


def names_in_calls(statement: st.Statement) -> Iterator[tuple[str, bool]]:
    """Yield the names that a statement hands to routines which may write them, and whether a part of each."""
    text = re.sub(r"(?<!\s)\s*+\.\s*+", ".", statement.text)
    handed = type(statement) is st.Statement
    if isinstance(statement, st.Routine) or _VALUELESS.search(text):
        return
    match statement:
        case st.Call(name=name):
            handed = not _READERS.fullmatch(name)
        case st.Assignment(kind=""):
            handed = "\\" in text.partition(":=")[0]  # the option of a call is written like an assignment
    stack = [handed]
    for token in _TOKEN.finditer(text):
        if token["open"]:
            routine = token["routine"] or ""
            stack.append(stack[-1] or not (_READERS.fullmatch(routine) or _WORDS.fullmatch(routine)))
        elif token["close"]:
            stack = stack[:-1] or [handed]
        elif stack[-1]:
            yield token["name"], token["part"] is not None


def calls_any(statement: st.Statement, routines: Collection[str]) -> bool:
    """Tell whether a statement calls one of these routines, in small letters."""
    return any(word.lower() in routines for word in re.findall(r"[A-Za-z]\w*", statement.text))


def may_change(p: Placed) -> str:
    """Return the note about a name that a statement hands to a routine."""
    said = " ".join(p.statement.text.split())
    return f"may be changed by '{said[:60]}' in {p.where}"


_TOOL = re.compile(rf"\[\s*TRUE\s*,\s*(?P<pose>{POSE})\s*,.*", re.IGNORECASE | re.DOTALL)
_WORK_OBJECT = re.compile(
    rf"\[\s*FALSE\s*,\s*TRUE\s*,\s*(?:\"\s*\")?\s*,\s*(?P<user>{POSE})\s*,\s*(?P<object>{POSE})\s*\]", re.IGNORECASE
)
_KINDS = ("tooldata", "wobjdata")
_FRAME_NAME = r"([A-Za-z]\w*(?:\{[^}]*\})?)\s*+(?=\\|$)"


class FrameTable:
    """The frames that the files declare, and which of them change while the program runs.

    Attributes:
        notes: line and sentence of each frame in use that a routine of the controller may have changed.
    """

    def __init__(self, placed: Sequence[Placed], names: Names, routines: Collection[str], given: ToolAndBase) -> None:
        self._given, self._names = given, names
        self._doubted: dict[str, str] = {}  # that a routine of the controller may write, in another module
        self._tools: dict[str, Frame] = {"tool0": np.eye(4)}
        self._objects: dict[str, Frame] = {"wobj0": np.eye(4)}
        self._handed: dict[str, str] = {}
        for p in placed:
            if isinstance(p.statement, st.Assignment) and p.statement.kind in _KINDS:
                self._declare(p, p.statement, names.key_of(p, p.statement.name))
        for p in placed:
            if isinstance(p.statement, st.Assignment) and not p.statement.kind:
                self._change(p, p.statement, names.resolve(p, p.statement.name))
            if handed := {name for name, _ in names_in_calls(p.statement)}:
                table = self._handed if not p.beside or calls_any(p.statement, routines) else self._doubted
                why = may_change(p)
                for name in sorted(handed):
                    table.setdefault(names.resolve(p, name), f"{name} {why}")
        self.notes: dict[str, tuple[int, str]] = {}
        self._missing: dict[str, set[str]] = {"tool": set(), "base": set()}
        for p in placed:
            if isinstance(p.statement, RapidMove) and not p.beside:
                self.of(p, p.statement)

    def _declare(self, p: Placed, statement: st.Assignment, key: str) -> None:
        unknown = f"{statement.name} ({p.where}) stands still, is moved or is not declared with plain numbers"
        if statement.kind == "tooldata":
            tool = _TOOL.fullmatch(statement.value)
            self._tools[key] = unknown if tool is None else _transform(tool["pose"])
        elif statement.kind == "wobjdata":
            found = _WORK_OBJECT.fullmatch(statement.value)
            user, placed = ("", "") if found is None else (_transform(found["user"]), _transform(found["object"]))
            self._objects[key] = unknown if isinstance(user, str) or isinstance(placed, str) else user @ placed

    def _change(self, p: Placed, statement: st.Assignment, key: str) -> None:
        """One of the file's frames, or a name of another file, is given a value while the program runs."""
        variable = statement.text.partition(":=")[0].strip()
        why = f"{variable} is changed in {p.where} while the program runs"
        if key in self._tools or "." not in key:
            self._tools[key] = why
        if key in self._objects or "." not in key:
            self._objects[key] = why

    def knows(self, key: str) -> bool:
        """Return whether a tool or a work object has this key."""
        return key in self._tools or key in self._objects

    def sources(self, placed: Sequence[Placed]) -> dict[str, int]:
        """Return the keys of all that a tool or a work object is made from, in any number of steps, and a line each."""
        made = list[tuple[str, set[str], int]]()
        for p in placed:
            if isinstance(s := p.statement, st.Assignment):
                left = self._names.key_of(p, s.name) if s.kind else self._names.resolve(p, s.name)
                right = {self._names.resolve(p, name) for name in re.findall(r"[A-Za-z]\w*", s.value)}
                made.append((left, right, s.line))
        return trace_sources(made, {left for left, _, _ in made if self.knows(left)})

    def of(self, p: Placed, move: RapidMove) -> FramePair:
        """Return tool and base of a move, which its last argument names (but for a signal), or why they are unknown."""
        at = 3 + move.word.startswith("movec") if re.search(r"(do|ao|go|sync)$", move.word) else -1
        said = next((a.text for a in move.arguments[at:]), "")
        tool, option = re.match(_FRAME_NAME, said), re.search(r"\\\s*WObj\b", said, re.IGNORECASE)
        work_object = re.match(rf"\s*:=\s*{_FRAME_NAME}", said[option.end() :]) if option else None
        if tool is None or (option and work_object is None):
            what = "tool" if tool is None else "work object"
            why = f"the {what} of the move in line {move.line} is no name: its frame is not certain"
            return why, why
        return (
            self._find(p, "tool", tool[1], self._tools, self._given.T_FT),
            self._find(p, "base", "wobj0" if work_object is None else work_object[1], self._objects, self._given.T_WB),
        )

    def _find(self, p: Placed, what: str, name: str, table: dict[str, Frame], given: Array | None) -> Frame:
        key = self._names.resolve(p, name.partition("{")[0].strip())
        if key in self._handed and key not in ("tool0", "wobj0"):
            return self._handed[key]
        found = table.get(key, "")
        if not isinstance(found, str) or found:
            if key in self._doubted:
                self.notes.setdefault(key, (p.statement.line, f"{self._doubted[key]}: taken as it is in the files"))
            return found
        if self._names.declares(key):
            return f"{name} is a parameter, a variable or one of a row: its value at the move is not certain"
        self._missing[what].add(key)
        if given is not None and len(self._missing[what]) == 1:
            return given
        return (
            f"{name or 'the ' + what} is not declared with plain numbers: declare it in the module, give a module "
            f"that does (--frames), or name it yourself where it is the only one (--{what})"
        )

    def default_frames(self, because: str) -> FramePair:
        """Return the frames that the person named, for a target whose moves are not in the file."""
        T_FT, T_WB = self._given.T_FT, self._given.T_WB
        why = f"{because}, so that its tool and work object are not known (--tool, --base)"
        return why if T_FT is None else T_FT, why if T_WB is None else T_WB


def _transform(pose: str) -> Frame:
    values = np.array([float(m[0]) for m in re.finditer(st.EXPONENT_NUMBER, pose)])
    if abs(np.linalg.norm(values[3:7]) - 1.0) > 1e-3:
        return ""
    return pose_matrix(values[:3] * MM, values[3:7])


@dataclass(frozen=True)
class _Mode:
    """An instruction that holds until the next one of its kind.

    Attributes:
        word: the instruction.
        free: it, with the switches behind which the orientation of a target is not reached.
        kept: it, with those behind which it is.
        moves: words of the moves that it is for.
        on: what these are.
    """

    word: re.Pattern[str]
    free: re.Pattern[str]
    kept: re.Pattern[str]
    moves: re.Pattern[str]
    on: str


def _mode(word: str, free: str, kept: str, moves: str, on: str) -> _Mode:
    texts = (rf"{word}\b", rf"\b{word}\s*\\\s*(?:{free})\b", rf"{word}\b{kept}", moves)
    patterns = [re.compile(text, re.IGNORECASE) for text in texts]
    return _Mode(patterns[0], patterns[1], patterns[2], patterns[3], on)


_CIRCLE = r"(?:move|trigg|search|arc|cap|disp|paint)c"
_MODES = (
    _mode(
        "SingArea", r"Wrist|LockAxis4", r"\s*\\\s*Off\b", r"(?!(?:move|trigg)(?:j|absj)|spotj)", "a line or a circle"
    ),
    # two axes of the wrist turn, and only the projection of the tool's axis follows the circle
    _mode("CirPathMode", r"Wrist\d\d", r"(?!\s*\\\s*Wrist)", _CIRCLE, "a circle"),
)


def is_linear(move: RapidMove) -> bool:
    """Tell whether a move is a line or a circle."""
    return _MODES[0].moves.match(move.word) is not None


def is_circle(word: str) -> bool:
    """Tell whether a move by this word has a point on its way and another at its end."""
    return re.match(_CIRCLE, word) is not None


class ToolTurning:
    """Which modes may hold at a statement, taken in the order of the file.

    A mode holds beyond the end of a routine and of a cycle: one that stands anywhere holds everywhere, but where the
    statements before say another for certain.
    """

    def __init__(self, placed: Sequence[Placed]) -> None:
        self._free = [next((p for p in placed if mode.free.search(p.statement.text)), None) for mode in _MODES]
        self._kept = [False for _ in _MODES]

    def follow(self, said: st.Statement) -> None:
        """Process the next statement of the file: it may set a mode, or make one uncertain."""
        for k, mode in enumerate(_MODES):
            if mode.word.match(said.text):
                self._kept[k] = mode.kept.match(said.text) is not None
                return
        if isinstance(said, st.Call | st.Flow | st.Routine | st.RoutineEnd) or type(said) is st.Statement:
            self._kept = [False for _ in _MODES]

    def describe_doubt(self, p: Placed, move: RapidMove) -> str:
        """Say why a move may end in another orientation than its target says; nothing where it does not."""
        for mode, free, kept in zip(_MODES, self._free, self._kept, strict=True):
            if free is not None and (p.beside or not kept) and mode.moves.match(move.word):
                found = mode.free.search(free.statement.text)
                assert found is not None
                instruction = re.sub(r"\s*\\\s*", r" \\", found[0])
                return f"{instruction} in {free.where} lets the tool turn otherwise in {mode.on}"
        return ""
