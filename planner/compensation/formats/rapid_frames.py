"""Tools and work objects of a RAPID file, by the key of their declaration."""

import re
from collections.abc import Sequence

import numpy as np

import planner.programs.languages.statements as st
from planner.common.units import MM, Array
from planner.compensation.formats.rapid_scopes import Names, Placed
from planner.compensation.points import Frame, FramePair
from planner.compensation.rotations import pose_matrix
from planner.compensation.targets import ToolAndBase
from planner.programs.languages.rapid import POSE, RapidMove, parse
from planner.programs.languages.text import EXPONENT_NUMBER

_TOOL = re.compile(rf"\[\s*TRUE\s*,\s*(?P<pose>{POSE})\s*,.*", re.IGNORECASE | re.DOTALL)
_WORK_OBJECT = re.compile(
    rf"\[\s*FALSE\s*,\s*TRUE\s*,\s*(?:\"\s*\")?\s*,\s*(?P<user>{POSE})\s*,\s*(?P<object>{POSE})\s*\]", re.IGNORECASE
)
_KINDS = ("tooldata", "wobjdata")


class FrameTable:
    """The frames that the files declare, and which of them change while the program runs."""

    def __init__(self, placed: Sequence[Placed], names: Names, given: ToolAndBase) -> None:
        self._given, self._names = given, names
        self._tools: dict[str, Frame] = {"tool0": np.eye(4)}
        self._objects: dict[str, Frame] = {"wobj0": np.eye(4)}
        for statement in parse(given.data):
            if isinstance(statement, st.Assignment):
                self._declare(statement, statement.name)
        for p in placed:
            if isinstance(p.statement, st.Assignment) and p.statement.kind in _KINDS:
                self._declare(p.statement, names.own(p, p.statement.name))
        for p in placed:
            if isinstance(p.statement, st.Assignment) and not p.statement.kind:
                self._change(p.statement, names.resolve(p, p.statement.name))

    def _declare(self, statement: st.Assignment, key: str) -> None:
        if statement.kind == "tooldata":
            tool = _TOOL.fullmatch(statement.value)
            self._tools[key] = "" if tool is None else _transform(tool["pose"])
        elif statement.kind == "wobjdata":
            found = _WORK_OBJECT.fullmatch(statement.value)
            user, placed = ("", "") if found is None else (_transform(found["user"]), _transform(found["object"]))
            self._objects[key] = "" if isinstance(user, str) or isinstance(placed, str) else user @ placed

    def _change(self, statement: st.Assignment, key: str) -> None:
        """One of the file's frames, or a name of another file, is given a value while the program runs."""
        variable = statement.text.partition(":=")[0].strip()
        why = f"{variable} is changed in line {statement.line} while the program runs"
        if key in self._tools or "." not in key:
            self._tools[key] = why
        if key in self._objects or "." not in key:
            self._objects[key] = why

    def knows(self, key: str) -> bool:
        """Return whether a tool or a work object has this key."""
        return key in self._tools or key in self._objects

    def of(self, p: Placed, move: RapidMove) -> FramePair:
        """Return tool and base of a move, which its last argument names, or why they are not known."""
        said = next((a.text for a in reversed(move.arguments) if not a.text.startswith("[")), "")
        tool = re.match(r"[A-Za-z]\w*(?:\{[^}]*\})?", said)
        work_object = re.search(r"\\\s*WObj\s*:=\s*(\w+(?:\{[^}]*\})?)", said, re.IGNORECASE)
        return (
            self._find(p, "tool", "" if tool is None else tool[0], self._tools, self._given.T_FT),
            self._find(p, "base", "wobj0" if work_object is None else work_object[1], self._objects, self._given.T_WB),
        )

    def _find(self, p: Placed, what: str, name: str, table: dict[str, Frame], given: Array | None) -> Frame:
        found = table.get(self._names.resolve(p, name), "")
        if not isinstance(found, str) or found:
            return found
        if given is not None:
            return given
        option = "--tool" if what == "tool" else "--base"
        return (
            f"{name or 'the ' + what} is not declared with plain numbers: declare it in the module, give a module "
            f"that does (--frames), or name it yourself ({option})"
        )

    def default_frames(self, because: str) -> FramePair:
        """Return what the person has named, for a target whose moves are not in the file."""
        T_FT, T_WB = self._given.T_FT, self._given.T_WB
        why = f"{because}, so that its tool and work object are not known (--tool, --base)"
        return why if T_FT is None else T_FT, why if T_WB is None else T_WB


def _transform(pose: str) -> Frame:
    values = np.array([float(m[0]) for m in re.finditer(EXPONENT_NUMBER, pose)])
    if abs(np.linalg.norm(values[3:7]) - 1.0) > 1e-3:
        return ""
    return pose_matrix(values[:3] * MM, values[3:7])
