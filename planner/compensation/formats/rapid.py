"""ABB RAPID: joint targets and robtargets, with the confdata, the tools and the work objects that go with them."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

import planner.compensation.points as pt
import planner.compensation.targets as tg
import planner.programs.languages.statements as st
from planner.common.units import MM, Array, read_only
from planner.compensation.arm_shapes import ConfData
from planner.compensation.formats.rapid_frames import (
    FrameTable,
    Names,
    Placed,
    ToolTurning,
    calls_any,
    is_circle,
    is_linear,
    is_read_only,
    may_change,
    names_in_calls,
    place,
)
from planner.compensation.rotations import pose_matrix
from planner.programs.dialect import Dialect
from planner.programs.languages.rapid import JOINT_TARGET, ROB_TARGET, UNUSED_AXIS, Argument, RapidMove, parse

_DISPLACED = re.compile(r"\b(PDispOn|PDispSet|EOffsOn|EOffsSet|CorrCon|Set(?:All)?DataVal|DeactUnit)\b", re.IGNORECASE)
_SENSOR_MOVE = re.compile(r"\bEGM(?:Run|Move|Stream)\w*", re.IGNORECASE)
_EXTERNAL_MOVE = re.compile(r"\bMoveExtJ\b|\bInd[ACDR]Move\b", re.IGNORECASE)
_EXTERNAL_GIVEN = re.compile(r"\.\s*extax\s*+(?:\.\s*eax_(?P<axis>[a-f])\s*+)?$", re.IGNORECASE)
_TARGETS = {"jointtarget": JOINT_TARGET, "robtarget": ROB_TARGET}
_CONF_OFF = re.compile(r"\b(Conf[JL])\s*\\\s*Off\b", re.IGNORECASE)
_OPTIONS = r"(?:\s*\\\s*\w+\s*(?::=\s*[\w.{}]+)?)*"
_RELATIVE = re.compile(r"(Offs|RelTool)\s*\(\s*(\w+)", re.IGNORECASE)
_WHOLE = re.compile(r"(?<![\w.])[A-Za-z]\w*+(?!\s*\.)")  # names of which no component is taken
_COMPUTED = "is computed while the program runs"


def read(text: str, _dialect: Dialect, reading: tg.TargetReading) -> None:
    """Note the targets of one file, declared or written at their move."""
    placed = list(place(list(parse(text))))
    own = {p.module for p in placed}
    beside = [p for p in place(list(parse(reading.frames.data)), beside=True) if not p.module or p.module not in own]
    targets = _RapidTargets(placed, beside, reading)
    for p in (*placed, *beside):
        targets.read_changes(p)
    for key, line in targets.frames.sources([*placed, *beside]).items():
        if targets.points.has(key):
            targets.points.compute(key, f"makes a tool or a work object (line {line})")
    for p in beside:
        targets.take_beside(p)
    for p in placed:
        targets.take(p)
    targets.finish()


class _RapidTargets:
    """Declarations and moves of a file."""

    def __init__(self, own: Sequence[Placed], beside: Sequence[Placed], reading: tg.TargetReading) -> None:
        placed = [*own, *beside]
        self.reading = reading
        self.names = Names(placed)
        self.points = pt.PointTable(reading, "module")
        self.heads = {
            r.name.lower(): r.text.partition("(")[2] for p in placed if isinstance(r := p.statement, st.Routine)
        }
        self.frames = FrameTable(placed, self.names, self.heads, reading.frames)
        self.displaced = next((p for p in placed if _DISPLACED.search(p.statement.text)), None)
        self.conf_off = {m[1].lower(): p.where for p in own if (m := _CONF_OFF.search(p.statement.text))}
        self.conf_off_beside = next((p for p in beside if _CONF_OFF.search(p.statement.text)), None)
        self.turning = ToolTurning(placed)
        self.copies: dict[str, set[str]] = {}  # of variables, the points that they are copies of
        self.driven = _driven_axes(placed)
        self.last: int | None = None  # index of the target that the arm comes from, where that is certain

    def read_changes(self, p: Placed) -> None:
        """Read what gives points a value, and which parts of them are handed to routines that may write them."""
        if isinstance(p.statement, st.Assignment):
            self._read_value(p, p.statement)
        if handed := set(names_in_calls(p.statement)):
            why, may_write = may_change(p), self._may_write(p.statement)
            for name, part in sorted(handed):
                if part or may_write:
                    self.points.compute(self.names.resolve(p, name), why)

    def _may_write(self, statement: st.Statement) -> bool:
        """Tell whether a routine that a statement calls is not in the file, or takes anything to be written."""
        called = {statement.name} if isinstance(statement, st.Call) else set[str]()
        called |= set(re.findall(r"(?<![\w.\\])([a-z]\w*)\s*\(", statement.text.lower()))
        called = {name.lower() for name in called if not is_read_only(name)}
        return any(re.search(r"\b(INOUT|VAR|PERS)\b", self.heads.get(name, "INOUT"), re.IGNORECASE) for name in called)

    def _read_value(self, p: Placed, statement: st.Assignment) -> None:
        kind, value = statement.kind, statement.value
        if not kind:
            key = self.names.resolve(p, statement.name)
            if not self._is_copy(p, statement, key):
                self._use_elsewhere(p, set(re.findall(r"[A-Za-z]\w*", value)), set(_WHOLE.findall(value)))
            if self._is_given_whole(p, statement, key):
                given = _numbers(value, statement.value_start)
                self.points.declare(pt.DeclaredPose(key, statement.line, given))
            elif not self.frames.knows(key):
                self.points.compute(key, f"{_COMPUTED} ({p.where})")
        elif kind in _TARGETS and not p.beside:
            pattern = _TARGETS[kind]
            rows = list(pattern.finditer(value)) if statement.part else [pattern.fullmatch(value)]
            name = self.names.key_of(p, statement.name)
            if statement.part and (others := re.findall(r"[A-Za-z]\w*", pattern.sub(" ", value))):
                for other in (name, *(self.names.resolve(p, o) for o in others)):
                    self.points.compute(other, f"stands in a row of names and numbers (line {statement.line})")
            for k, row in enumerate(rows, start=1):
                numbers = None if row is None else _numbers(row[0], statement.value_start + row.start())
                line = statement.line + (0 if row is None else value[: row.start()].count("\n"))
                self.points.declare(pt.DeclaredPose(f"{name}{{{k}}}" if statement.part else name, line, numbers))

    def _is_copy(self, p: Placed, statement: st.Assignment, key: str) -> bool:
        """Tell whether a variable of the file gets a point as it is: moves to it are left, as it is computed."""
        names = [text.strip() for text in (statement.text.partition(":=")[0], statement.value)]
        if not self.names.is_variable(key) or not all(re.fullmatch(r"\w+", name) for name in names):
            return False
        self.copies.setdefault(key, set()).add(self.names.resolve(p, names[1]))
        return True

    def _is_given_whole(self, p: Placed, statement: st.Assignment, key: str) -> bool:
        """Tell whether a variable without a value of its own gets a target with plain numbers here."""
        whole = any(pattern.fullmatch(statement.value) for pattern in _TARGETS.values())
        plain = re.fullmatch(r"\w+", statement.text.partition(":=")[0].strip())
        return bool(whole and plain) and not p.beside and self.names.is_variable(key)

    def _note_hidden_targets(self, p: Placed) -> None:
        """Leave the targets of a statement that is no move, and no declaration of a target."""
        said = p.statement
        text, value = said.text, said.value if isinstance(said, st.Assignment) else said.text
        if isinstance(said, RapidMove) or (isinstance(said, st.Assignment) and said.kind in _TARGETS):
            return
        if isinstance(said, st.Assignment) and self._is_given_whole(p, said, self.names.resolve(p, said.name)):
            return
        for pattern in _TARGETS.values():
            for found in pattern.finditer(value):
                line = said.line + value[: found.start()].count("\n")
                self.reading.leave(line, f"a target in '{text[:60]}' found; those of moves are corrected")

    def _frames_of(self, p: Placed, move: RapidMove) -> pt.FramePair:
        """Return tool and base of a move, or why it does not go to where its target says."""
        why = self.turning.describe_doubt(p, move)
        return (why, why) if why else self.frames.of(p, move)

    def take(self, p: Placed) -> None:
        """Process one statement, now that all declarations are known."""
        said = p.statement
        self._hand_points(p)
        self._note_hidden_targets(p)
        self.turning.follow(said)
        if sensor := _SENSOR_MOVE.search(said.text):
            self.reading.leave(said.line, f"{sensor[0]} found: a sensor drives the arm, and no target is in the file")
        match said:
            case RapidMove() as move:
                beside = not move.text.lower().startswith(move.word)  # behind a condition, a label, a case, ERROR
                self.last = None if beside else self.last
                self._move(p, move)
                self.last = None if beside else self.last
            case st.Call() | st.Flow() | st.Routine() | st.RoutineEnd():
                self.last = None
            case _ if type(said) is st.Statement:
                self.last = None

    def _hand_points(self, p: Placed) -> None:
        """A routine or a function may drive to the points that it is given."""
        said = p.statement
        names = {name for name, part in names_in_calls(said) if not part}
        if isinstance(said, st.Call):
            names |= set(re.findall(r"[A-Za-z]\w*", said.text.partition(said.text.split()[0])[2]))
        self._use_elsewhere(p, names, names)

    def take_beside(self, p: Placed) -> None:
        """Note where a statement of another module drives to points of the file."""
        self._hand_points(p)
        if isinstance(move := p.statement, RapidMove):
            for argument in move.arguments:
                name = re.match(r"(?:(?:Offs|RelTool)\s*\(\s*)?([A-Za-z]\w*)\s*(\{[^}]*\})?", argument.text)
                key = self.names.resolve(p, name[1]) + (name[2] or "") if name else ""
                if self.points.has(key):
                    self.points.use(key, 0, pt.Use(self._frames_of(p, move), None, linear=False))

    def _use_elsewhere(self, p: Placed, names: set[str], whole: set[str]) -> None:
        """Note points that a statement hands on: a routine of the file, or that of another, may drive to them.

        Of those that are handed on ``whole``, the points that they are copies of count too.
        """
        keys = dict.fromkeys(self.names.resolve(p, name) for name in sorted(names))
        for key in (queue := [self.names.resolve(p, name) for name in sorted(whole)]):
            queue += (more := sorted(name for name in self.copies.get(key, ()) if name not in keys))
            keys |= dict.fromkeys(more)
        points = [key for key in keys if self.points.has(key)]
        if not points:
            return
        why = f"it is handed on in line {p.statement.line}"
        frames = self._frames_of(p, p.statement) if isinstance(p.statement, RapidMove) else (why, why)
        if isinstance(p.statement, st.Call) and p.statement.name != "return" and not self._says_frames(p):
            frames = self.frames.default_frames(why)
        for key in points:
            if not self.points.is_computed(key, _COMPUTED):
                self.points.use(key, 0, pt.Use(frames, None, linear=False))

    def _says_frames(self, p: Placed) -> bool:
        """Tell whether a call is of a routine of the files, or names one of their tools or work objects."""
        words = re.findall(r"[A-Za-z]\w*", p.statement.text)
        knows = any(self.frames.knows(self.names.resolve(p, word)) for word in words)
        return knows or calls_any(p.statement, self.heads)

    def finish(self) -> None:
        """Note the targets that are declared by name, with the frames of the moves that use them."""
        self.reading.notes.extend(self.frames.notes.values())
        if self.conf_off_beside is not None:
            said = f"confdata are taken as written, though {self.conf_off_beside.where} switches them off"
            self.reading.notes.append((1, said))
        for pose in self.points.finish():
            assert isinstance(pose.value, list)
            if len(pose.value) == 12:
                self._joints(pose.line, pose.value, pose.uses, pose.index)
            else:
                self._pose(pose.line, pose.value, pose.uses, pose.index)

    def _move(self, p: Placed, move: RapidMove) -> None:
        if pt.is_service_name(p.routine):
            self.reading.leave(move.line, f"{p.routine} {pt.SENTENCE}")
            self.last = None
            return
        first = 0
        if move.word.startswith("search"):  # signal, what is found, and then the targets
            first = 2
            found = (
                self.names.resolve(p, move.arguments[min(1, len(move.arguments) - 1)].text) if move.arguments else ""
            )
            self.points.compute(found, f"{_COMPUTED} (line {move.line})")
        last = first + (2 if is_circle(move.word) else 1)
        for argument in move.arguments[first:last]:
            use = pt.Use(self._frames_of(p, move), self.last, is_linear(move))
            self.last = self._argument(p, move.line, argument, use)

    def _argument(self, p: Placed, line: int, argument: Argument, use: pt.Use) -> int | None:
        value = re.sub(rf"{_OPTIONS}\s*$", "", argument.text)
        name = re.fullmatch(r"[A-Za-z]\w*(?:\s*\{[^}]*\})?", value)
        if JOINT_TARGET.fullmatch(value):
            return self._joints(line, _numbers(value, argument.start), [use])
        if ROB_TARGET.fullmatch(value):
            return self._pose(line, _numbers(value, argument.start), [use])
        if name:
            base, brace, rest = name[0].partition("{")
            key = self.names.resolve(p, base.strip()) + brace + rest
            return self.points.use(key, line, use)
        if relative := _RELATIVE.match(value):
            key = self.names.resolve(p, relative[2])
            self.points.use(key, 0, replace(use, follows=None))
            gets = "it gets the correction of that point, not its own" if self.points.has(key) else "it is computed"
            self.reading.leave(line, f"{relative[1]} from {relative[2]} found: {gets}")
        else:
            self.reading.leave(line, f"'{value[:60]}' found as a target; a name or plain numbers are allowed")
        return None

    def _joints(
        self, line: int, found: list[st.PlacedNumber], uses: Sequence[pt.Use], index: int | None = None
    ) -> int | None:
        found = found[: self.reading.robot.n_joints]
        if beyond := next((n for n in found if n.value > UNUSED_AXIS), None):
            said = f"an axis without an angle ({beyond.text[:20]})"
            self.reading.leave(line, f"{said} found; the robot has {len(found)} joints")
            return None
        tool = pt.common_tool(uses, self.frames.default_frames("no move of this file uses it"))
        return self.reading.add_joints(line, found, index, tool)

    def _pose(
        self, line: int, found: list[st.PlacedNumber], uses: Sequence[pt.Use], index: int | None = None
    ) -> int | None:
        """Note a robtarget; where confdata is switched off, the arm keeps the shape in which it comes."""
        values = [number.value for number in found]
        off = {self.conf_off.get("confl" if use.linear else "confj", "") for use in uses}
        known = [use.follows for use in uses if use.follows is not None]
        T_FT, T_WB = pt.common_frames(uses, self.frames.default_frames("no move of this file uses it"))
        why = self._why_not(values, (T_FT, T_WB), bool(off - {""}))
        if not why and off - {""} and (len(known) < len(uses) or "" in off):
            why = f"confdata is switched off in {max(off)}, and the target that the arm comes from is not certain"
        if why:
            self.reading.leave(line, why)
            return None
        assert not isinstance(T_FT, str)
        assert not isinstance(T_WB, str)
        conf = [round(v) for v in values[7:11]]
        configuration = None if off - {""} else ConfData((conf[0], conf[1], conf[2]), conf[3])
        units = [(MM, tg.MM_DECIMALS)] * 3 + [(1.0, 8)] * 4  # decimals of a quaternion at least
        units += [(1.0, 0)] * 4 if configuration else []
        slots = tuple(number.slot(*unit) for number, unit in zip(found, units, strict=False))
        pose = tg.CartesianTarget(_pose_of(values), "quaternion", read_only(values[3:7]), T_WB, T_FT, configuration)
        return self.reading.add(tg.Target(line, slots, pose=pose, follows=() if configuration else tuple(known)), index)

    def _why_not(self, values: list[float], frames: pt.FramePair, off: bool) -> str:
        """Say why the file does not say for certain where the arm is to stand, if it does not."""
        size = float(np.linalg.norm(values[3:7]))
        if abs(size - 1.0) > 1e-3:
            return f"the quaternion has the length {size:.4f}; 1 is allowed"
        if not off and not 0 <= round(values[10]) <= 3:
            return f"cfx = {values[10]:g} found; 0 … 3 are allowed (the wrist in front of axis 1), or a jointtarget"
        if self.displaced is not None:
            word = _DISPLACED.search(self.displaced.statement.text)
            assert word is not None
            return f"{word[0]} in {self.displaced.where} makes the meaning of this target uncertain"
        if why := next((f for f in frames if isinstance(f, str)), ""):
            return why
        kept = next((k for k in sorted(self.driven) if values[11 + k] > UNUSED_AXIS), None)
        if kept is not None:
            axis = "abcdef"[kept]
            return f"external axis eax_{axis} has no value here and keeps its last one, which other targets set"
        return tg.EXTERNAL if any(abs(v) < UNUSED_AXIS and v != 0.0 for v in values[11:]) else ""


def _numbers(value: str, start: int) -> list[st.PlacedNumber]:
    return st.placed_numbers(value, start, st.EXPONENT_NUMBER)


def _driven_axes(placed: Sequence[Placed]) -> set[int]:
    """Return which external axes the files move, from 0: all of them where a target of theirs is not in the files."""
    driven = set[int]()
    for p in placed:
        text = p.statement.text
        for pattern in _TARGETS.values():
            for found in pattern.finditer(text):
                external = [float(m[0]) for m in re.finditer(st.EXPONENT_NUMBER, found[0])][-6:]
                driven |= {k for k, value in enumerate(external) if value != 0.0 and value < UNUSED_AXIS}
        if _EXTERNAL_MOVE.search(text) and not JOINT_TARGET.search(text):
            driven |= set(range(6))
        if isinstance(p.statement, st.Assignment) and (given := _EXTERNAL_GIVEN.search(text.partition(":=")[0])):
            number = re.fullmatch(st.EXPONENT_NUMBER, p.statement.value)
            if number is None or (float(number[0]) != 0.0 and float(number[0]) < UNUSED_AXIS):
                driven |= {"abcdef".index(given["axis"].lower())} if given["axis"] else set(range(6))
    return driven


def _pose_of(values: Sequence[float]) -> Array:
    """Return the transform (4, 4) [m] of x, y, z [mm] and a quaternion."""
    return pose_matrix(np.array(values[:3]) * MM, np.array(values[3:7]))
