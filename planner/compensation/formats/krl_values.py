"""The frames that KRL files name: what each is, from ``$config.dat`` and the file, and which of them may change."""

import re
from collections.abc import Callable, Iterator, Sequence

import numpy as np

import planner.programs.languages.statements as st
from planner.common.units import DEG, MM, Array, read_only
from planner.compensation.formats.krl_calls import SELECTS_TAUGHT, FrameChanges, names_given_away, names_set_beside
from planner.compensation.points import Frame
from planner.compensation.rotations import frame, from_abc, inverse
from planner.compensation.targets import NOT_HELD, ToolAndBase
from planner.programs.languages.krl import POSE_KEYS, Aggregate, Bas, aggregate, parse

TABLE = re.compile(r"(TOOL|BASE)_DATA\[\s*(\w+)\s*\]")
KINDS = {"TOOL": "--tool", "BASE": "--base"}  # of frames, and the option that names one
_EVERYWHERE = ("$ROBROOT", "$WORLD")
_CORRECTIONS = re.compile(r"(BASE|TOOL|M_BASE)_COR(R(_W)?(_ON)?|_ON)|M_BAS_COR_ON")  # that BAS adds to tool and base
_FDAT = re.compile(r"FDAT_ACT|F\w+")


def transform(found: Aggregate | None) -> Array | None:
    """Return the transform (4, 4) [m] of a value with X, Y, Z, A, B, C, else None."""
    numbers = {} if found is None else found.numbers or {}
    if not set(POSE_KEYS) <= numbers.keys():
        return None
    values = np.array([numbers[key].value for key in POSE_KEYS])
    return read_only(frame(values[None, :3] * MM, from_abc(values[None, 3:] * DEG))[0])


def _no_frame(_name: str) -> Frame | None:
    return None


def frame_value(value: str, find: Callable[[str], Frame | None] = _no_frame) -> Frame | None:
    """Return the frame that an expression of frames gives, or why it is not certain; None where it is not understood.

    The geometric operator ``:`` multiplies the transforms (4, 4) [m] of its two sides, from left to right.

    Args:
        value: numbers in braces, names, ``INV_POS(…)`` and brackets, joined by ``:``.
        find: the frame of a name in one spelling, or None where there is none.
    """
    product: Array = np.eye(4)
    for factor in _factors(value):
        T = _factor(factor, find)
        if T is None or isinstance(T, str):
            return T
        product = product @ T
    return read_only(product)


def _factor(text: str, find: Callable[[str], Frame | None]) -> Frame | None:
    """Return the frame that one side of a geometric operator gives, or why it is not certain; None as above."""
    if text.upper() in ("$NULLFRAME", "$WORLD"):
        return np.eye(4)
    if text.startswith("{"):
        return transform(aggregate(text, 0))
    if inside := re.fullmatch(r"(INV_POS)?\s*\((.*)\)", text, re.IGNORECASE):
        T = frame_value(inside[2], find)
        return T if T is None or isinstance(T, str) or not inside[1] else inverse(T[None])[0]
    return find(spell_name(text))


def _factors(value: str) -> list[str]:
    """Return the sides of the geometric operators of an expression; those within brackets of any kind stay whole."""
    factors, depth = [""], 0
    for sign in value:
        depth += (sign in "{([") - (sign in "})]")
        if sign == ":" and depth == 0:
            factors.append("")
        else:
            factors[-1] += sign
    return [factor.strip() for factor in factors]


def plain_frame(value: str) -> Array | None:
    """Return the transform (4, 4) [m] that a value spells without names, or None."""
    T = frame_value(value)
    return None if isinstance(T, str) else T


def spell_name(name: str) -> str:
    """Return a name without blanks and in capitals: KRL does not tell such spellings apart."""
    return re.sub(r"\s", "", name).upper()


class FrameValues:
    """Frames by name, and the data with which points are taught (FDAT).

    Attributes:
        everywhere: why no tool and base of the file are certain, or empty.
        turned: why straight moves may keep their orientation, though no line says so; or empty.
        set_by_code: line of each frame that has its value only while the program runs.
    """

    def __init__(self, statements: Sequence[st.Statement], changes: FrameChanges, given: ToolAndBase) -> None:
        self._frames: dict[str, Frame] = {"TOOL_DATA[0]": np.eye(4), "BASE_DATA[0]": np.eye(4)}
        self._fdats: dict[str, str] = {}
        self._orientations: dict[str, str] = {}  # of straight moves, by the name of their LDAT
        self._on_kinematic: dict[str, str] = {}  # bases that stand on an external kinematic
        self.everywhere, self.turned, self.set_by_code, self._changes = "", "", dict[str, int](), changes
        said = [*parse(given.data), *statements]
        assigned = sorted((s for s in said if isinstance(s, st.Assignment)), key=changes.is_in_routine)  # data first
        self._plain = {spell_name(s.name) for s in assigned if not s.part and plain_frame(s.value) is not None}
        for s in assigned:
            self._take_frame(s)
            self._take_taught(s, spell_name(s.name))
        self._take_kinematics(assigned)
        self._take_doubts(statements)
        self._take_given_frames(list(self._selections(statements)), given)

    def __contains__(self, name: str) -> bool:
        return name in self._frames

    def find(self, name: str) -> Frame:
        """Return a frame by its name, or why it is not certain."""
        found = self._on_kinematic.get(name) or self._frames.get(name, "")
        if not isinstance(found, str) or found:
            return found
        which = KINDS.get(name[:4], "")
        hint = f", or name it yourself where it is the only one ({which})" if which else ""
        return f"{name} {NOT_HELD}: give the controller's $config.dat (--frames){hint}"

    def resolve_fdat(self, value: str) -> str:
        """Return the content of an FDAT given by name or in braces; empty where it is not certain."""
        return value.upper() if value.startswith("{") else self._fdats.get(spell_name(value), "")

    def orientation_of(self, ldat: str) -> str:
        """Return how straight moves with an LDAT, given by name or in braces, turn; nothing where it is not certain."""
        if ldat.startswith("{"):
            return _orientation_in(ldat)
        return self._orientations.get(spell_name(ldat), "")

    def taught_frame_data(self, point: str) -> str | None:
        """Return the FDAT of a point that inline forms have taught (XP1: FP1); None where it has none."""
        return self._fdats.get("F" + point[1:]) if point.startswith("X") else None

    def names_in(self, fdat: str) -> tuple[str, str] | str:
        """Return the names of tool and base that an FDAT selects, or why they are not certain."""
        numbers = dict(re.findall(r"\b(TOOL|BASE)_NO\s+(-?\d+)", fdat))
        if re.search(r"IPO_FRAME\s+#TCP", fdat):
            return "its tool stands still and the robot carries the part"
        if len(numbers) != 2:
            return "the data that its tool and base are taught with are not certain"
        if any(int(number) < 0 for number in numbers.values()):
            return "the data that it is taught with name no tool or no base: their number is negative"
        tool, base = (f"{which}_DATA[{int(numbers[which])}]" for which in KINDS)
        return tool, base

    def _take_frame(self, statement: st.Assignment) -> None:
        """Read a frame that has a name; one that changes has no certain value anywhere."""
        name = spell_name(statement.name)
        T = None if statement.part else plain_frame(statement.value)
        if name in _EVERYWHERE and (T is None or not np.allclose(T, np.eye(4))):
            self.everywhere = f"{_variable_name(statement)} is set in line {statement.line}"
        elif _CORRECTIONS.fullmatch(name) and self._changes.is_in_routine(statement):
            self.everywhere = f"{name}, which is added to tool or base, is set in line {statement.line}"
        elif name.startswith("$") or (T is None and name not in self._plain and not TABLE.fullmatch(name)):
            return
        elif (table := TABLE.fullmatch(name)) and not table[2].isdigit():
            self._frames |= dict.fromkeys(_rows(table), describe_change(statement))
        elif isinstance(self._frames.get(name), str):
            return  # its first change is named
        elif T is None or not np.array_equal(T, self._frames.get(name, T)):
            self._frames[name] = describe_change(statement)
        else:
            if not self._changes.is_in_routine(statement):
                self.set_by_code.pop(name, None)
            elif name not in self._frames:
                self.set_by_code[name] = statement.line
            self._frames[name] = T

    def _take_taught(self, statement: st.Assignment, name: str) -> None:
        """Read data that points are taught with (FDAT), and how straight moves turn (LDAT)."""
        value = "" if statement.part else statement.value
        if name != "FDAT_ACT" and (statement.kind == "FDAT" or name in self._fdats or _FDAT.fullmatch(name)):
            _note_statement(self._fdats, name, value.upper() if value.startswith("{") else "")
        if name != "LDAT_ACT" and (statement.kind == "LDAT" or name in self._orientations):
            _note_statement(self._orientations, name, _orientation_in(value))
            if not (statement.part or value.startswith("{") or spell_name(value) in self._orientations):
                self.turned = self.turned or describe_change(statement)

    def _take_kinematics(self, statements: Sequence[st.Assignment]) -> None:
        """Read which bases do not stand on the floor (MACHINE_FRAME_DAT, MACHINE_DEF of ``$config.dat``)."""
        own = [(spell_name(s.name), s.value.upper()) for s in statements]
        robots = {name for name, value in own if name.startswith("MACHINE_DEF[") and "#ROBOT" in value}
        for name, value in own:
            frame_of = re.fullmatch(r"MACHINE_FRAME_DAT(\[\d+\])", name)
            on = re.search(r"\bMACH_DEF_INDEX\s+(\w+)", value)
            if frame_of and on and on[1] != "0" and f"MACHINE_DEF[{on[1]}]" not in robots:
                base = f"BASE_DATA{frame_of[1]}"
                self._on_kinematic[base] = f"{base} stands on an external kinematic (MACHINE_DEF[{on[1]}])"

    def _take_doubts(self, statements: Sequence[st.Statement]) -> None:
        """Read frames of a row that is written at a computed place, and those that a routine is given."""
        last: dict[str, tuple[int, int]] = {}  # place and line of the last statement, by a name or a whole row, "F["
        tables = set[str]()
        for k, s in enumerate(statements):
            written = names_given_away(s) | names_set_beside(s)
            if isinstance(s, st.Assignment) and not _is_one(name := spell_name(s.name)):
                written.add(name)
            last |= dict.fromkeys((name if _is_one(name) else _row_of(name) for name in written), (k, s.line))
            tables |= {name for name in written if TABLE.fullmatch(name)}
            self._fdats |= dict.fromkeys(written & self._fdats.keys(), "")
            for name in sorted(written & self._orientations.keys()):
                self._orientations[name] = ""
                self.turned = self.turned or f"{name} may be changed in line {s.line} while the program runs"
        known = {*self._frames, *(row for name in tables if (table := TABLE.fullmatch(name)) for row in _rows(table))}
        for name in known:
            if found := max((last[key] for key in (name, _row_of(name)) if key in last), default=None):
                self._frames[name] = f"{name} may be changed in line {found[1]} while the program runs"

    def _selections(self, statements: Sequence[st.Statement]) -> Iterator[tuple[str, str]]:
        """Yield the kind and the name of every frame that the statements select; empty where that is computed."""
        for s in statements:
            match s:
                case Bas(what="TOOL" | "BASE" as kind, value=value):
                    yield kind, f"{kind}_DATA[{int(value)}]" if value.isdigit() else ""
                case Bas(what=what) if what in SELECTS_TAUGHT:
                    yield from (("TOOL", ""), ("BASE", ""))
                case st.Assignment(name="$TOOL" | "$BASE" as name, value=value):
                    yield name[1:], spell_name(value) if re.fullmatch(r"[A-Za-z_]\w*(\[\d+\])?", value) else ""
                case _ if re.search(r"\$(TOOL|BASE)\b[^=<>]*=(?!=)", s.text, re.IGNORECASE):
                    yield from (("TOOL", ""), ("BASE", ""))
        for fdat in self._fdats.values():
            yield from zip(KINDS, names, strict=True) if isinstance(names := self.names_in(fdat), tuple) else ()

    def _take_given_frames(self, selected: Sequence[tuple[str, str]], given: ToolAndBase) -> None:
        """Read what the person says: the one frame of a kind that the files select and do not hold."""
        self.unsaid: list[Array | None] = []
        for kind, T in zip(KINDS, (given.T_FT, given.T_WB), strict=True):
            names = {name for which, name in selected if which == kind}
            missing = {name for name in names if name and name not in self._frames}
            if T is not None and len(missing) == 1:
                self._frames[missing.pop()] = T
            self.unsaid.append(None if names else T)


def _is_one(name: str) -> bool:
    """Tell whether a name, in one spelling, means one variable: it has no index, or one that is a number."""
    return re.fullmatch(r"[^\[]*(\[\d+\])?", name) is not None


def _row_of(name: str) -> str:
    """Return what the names of all variables of a row begin with."""
    return name.partition("[")[0] + "["


def _rows(table: re.Match[str]) -> list[str]:
    """Return the names that a match of ``TABLE`` stands for: all rows where its index is computed."""
    rows = [int(table[2])] if table[2].isdigit() else range(1, 128 + 1)  # numbers of a table of frames at most
    return [f"{table[1]}_DATA[{row}]" for row in rows]


def _note_statement(table: dict[str, str], name: str, said: str) -> None:
    """Note what is said of a name; nothing is certain once something else has been."""
    table[name] = said if table.get(name, said) == said else ""


def _orientation_in(ldat: str) -> str:
    found = re.search(r"\bORI_TYP\s*(#\w+)", ldat.upper())
    return found[1] if found else ""


def _variable_name(statement: st.Assignment) -> str:
    return f"{statement.name}.{statement.part}" if statement.part else statement.name


def describe_change(statement: st.Assignment) -> str:
    """Return the note about a frame that a statement changes."""
    return f"{_variable_name(statement)} is changed in line {statement.line} while the program runs"
