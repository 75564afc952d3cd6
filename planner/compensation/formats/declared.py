"""Targets of every language whose parser says its positions and moves (:mod:`planner.programs.languages.declared`)."""

import re
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

import planner.compensation.points as pt
import planner.compensation.targets as tg
import planner.programs.languages.declared as said
import planner.programs.languages.statements as st
from planner.common.units import DEG, MM, Array, read_only
from planner.compensation.arm_shapes import WrittenShape
from planner.compensation.rotations import frame
from planner.programs.dialect import Dialect
from planner.programs.verification import EXECUTIONS

_NAME_NO_VALUE = (said.Position, said.Frame, said.FrameChange, said.Move, st.Passive)  # they write no frame
_BREAKS_THE_ROW = (st.Flow, st.Call, st.Routine, st.RoutineEnd)


def read(text: str, dialect: Dialect, reading: tg.TargetReading) -> None:
    """Note the targets of one file; the other files of its program stand in ``reading.companion``."""
    _DeclaredReader(text, dialect, reading).read()


class _DeclaredReader:
    """Goes through the statements in their order, and remembers the target before and the frames."""

    def __init__(self, text: str, dialect: Dialect, reading: tg.TargetReading) -> None:
        language = EXECUTIONS[dialect.reading.family]
        assert issubclass(language, said.DeclaredExecution)
        self.language, self.dialect, self.reading = language, dialect, reading
        self.own: list[st.Statement] = list(language.parse_file(text))
        self.others: list[st.Statement] = list(language.parse_file(reading.companion)) if reading.companion else []
        self.points = pt.PointTable(reading, "file")
        both = [*self.own, *self.others]
        self.positions = {s.name: s for s in both if isinstance(s, said.Position)}
        self.known = {s.name: s for s in both if isinstance(s, said.Frame)}
        self.tool: str | None = None
        self.base: str | None = None
        self.last: int | None = None
        self.names = {part for name in (*self.positions, *self.known) for part in (name, name.partition("[")[0])}
        others = (s for s in both if not isinstance(s, _NAME_NO_VALUE))
        self.written = {name for s in others for name in self._names_in(s.text)}  # or read, nobody knows

    def _names_in(self, text: str) -> Iterator[str]:
        """Yield the positions and frames that a text names; a row by its bare name where the index is no number."""
        for found in re.finditer(rf"(?<![\w#$.])#?[A-Za-z]{self.language.name_letter}*(\[[^\[\]]*\])?", text):
            name = found[0].lower() if self.language.any_case else found[0]
            row = name.partition("[")[0]
            if name in self.names:
                yield name
            elif row in self.names and not re.fullmatch(r"\[\s*\d+\s*\]", found[1] or ""):
                yield row

    def read(self) -> None:
        """Note what is corrected and what is left."""
        lines = {id(s): s.line for s in self.own}
        for statement in (*self.own, *self.others):
            if isinstance(statement, said.Position):
                numbers = list(statement.joints or statement.pose) or None
                line = lines.get(id(statement), 0)
                self.points.declare(pt.DeclaredPose(statement.name, line, numbers, bool(statement.joints)))
                if statement.why_not:
                    self.points.compute(statement.name, statement.why_not)
        for part in (self.own, self.others):
            self.last = self.tool = self.base = None
            for statement in part:
                self._statement(statement, lines.get(id(statement), 0))
        for pose in self.points.finish():
            self._target(self.positions[pose.name], pose)

    def _statement(self, statement: st.Statement, line: int) -> None:
        shown = f"'{' '.join(statement.text.split())[:60]}' in line {statement.line}"
        if re.match(self.language.shifts, statement.text, re.IGNORECASE):
            self.reading.refuse(statement.line, f"{shown}: what it adds to the targets is not known here")
        match statement:
            case said.FrameChange():
                self.tool = self.tool if statement.tool is None else statement.tool
                self.base = self.base if statement.base is None else statement.base
            case said.Move():
                self._move(statement, line, shown)
            case said.Position() | said.Frame() | said.Words() | st.Passive():
                pass
            case st.MotionStatement():
                self.last = None
                if line:
                    self.reading.leave(line, f"{shown} found; moves to positions of the file are corrected")
                self._note_uses(statement, shown)
            case _:
                self.last = None if isinstance(statement, _BREAKS_THE_ROW) else self.last
                self._note_uses(statement, shown)

    def _note_uses(self, statement: st.Statement, shown: str) -> None:
        """A position that another statement names is not certain: it may be written there."""
        for name in self._names_in(statement.text):
            self.points.compute(name, f"is not certain: {shown} uses it too")

    def _move(self, move: said.Move, line: int, shown: str) -> None:
        for name in move.targets:
            if move.why_not:
                self.points.compute(name, f"is not certain: {shown} {move.why_not}")
            position = self.positions.get(name)
            frames = self._frames(move, position)
            self.last = self.points.use(name, line, pt.Use(frames, self.last, move.straight))
        if move.inline is not None and line:
            if move.why_not or not move.inline.joints or self.dialect.max_joints < len(move.inline.joints):
                self.reading.leave(line, f"{shown} {move.why_not or 'holds no plain numbers of all axes'}")
                self.last = None
            else:
                self.last = self._joints(move.inline, self._frames(move, move.inline)[0], None)
        elif move.why_not and line and not move.targets:
            self.reading.leave(line, f"{shown} {move.why_not}")
            self.last = None

    def _frames(self, move: said.Move, position: said.Position | None) -> pt.FramePair:
        """Return tool and base of a move, or why they are not known."""
        tools = (move.tool, position.tool if position else None, self.tool)
        tool = next((name for name in tools if name is not None), None)
        base = self.base if position is None or position.base is None else position.base
        given = self.reading.frames
        return self._frame("tool", tool, given.T_FT), self._frame("base", base, given.T_WB)

    def _frame(self, kind: str, name: str | None, given: Array | None) -> pt.Frame:
        found = self.known.get(name or "") or self.positions.get(name or "")
        if found is not None:
            numbers = found.numbers if isinstance(found, said.Frame) else found.pose
            written = not self.written.isdisjoint((found.name, found.name.partition("[")[0]))
            why_not = found.why_not or ("may be written by the program" if written else "is no pose")
            return f"{kind} {name} {why_not}" if not numbers or written else self._matrix(numbers)
        if name == "":
            return read_only(np.eye(4))
        if given is not None:
            return given
        return f"the file does not say the {kind} (--{kind})" if name is None else f"{name} {tg.NOT_HELD} (--{kind})"

    def _matrix(self, numbers: Sequence[st.PlacedNumber]) -> Array:
        values = np.array([n.value for n in numbers])
        R = Rotation.from_euler(self.language.rotation, values[3:] * DEG).as_matrix()
        return read_only(frame(values[None, :3] * MM, R[None])[0])

    def _target(self, position: said.Position, pose: pt.DeclaredPose) -> None:
        unused: pt.FramePair = ("", "")
        if position.joints:
            self._joints(position, pt.common_tool(pose.uses, unused), pose.index)
        else:
            self._pose(position, pt.common_frames(pose.uses, unused), pose)

    def _joints(self, position: said.Position, tool: pt.Frame, index: int | None) -> int | None:
        n, found = self.reading.robot.n_joints, position.joints
        if len(found) != n:
            self.reading.leave(position.line, f"{position.name} has {len(found)} axes, the robot has {n}")
            return None
        per_deg = self.reading.pulses_per_deg if self.dialect.pulses else (1.0,) * n
        decimals = 0 if self.dialect.pulses else tg.DEG_DECIMALS
        return self.reading.add_angles(position.line, found, [DEG / k for k in per_deg], decimals, index, tool)

    def _pose(self, position: said.Position, frames: pt.FramePair, pose: pt.DeclaredPose) -> None:
        T_FT, T_WB = frames
        line, where = position.line, f"where {position.name} lies is not certain"
        before = [use.follows for use in pose.uses if use.follows is not None]
        straight = all(use.linear for use in pose.uses)
        keeps = position.shape is None or bool(position.shape.unknown and straight)
        follows = tuple(before) if len(before) == len(pose.uses) and keeps else ()
        if self.reading.p_MC is None:
            at = f"give base_mm under [controllers.{self.dialect.name}] of {self.reading.robot.path.name}"
            self.reading.leave(line, f"{where}: nobody says where the controller's base frame lies ({at})")
        elif isinstance(T_FT, str) or isinstance(T_WB, str):
            why = next((f for f in frames if isinstance(f, str) and f), "no move of the file drives to it")
            self.reading.leave(line, f"{where}: {why}")
        elif keeps and not follows:
            self.reading.leave(line, f"{where}: the target before it, whose shape of the arm is kept, is not known")
        else:
            shape = None if keeps or position.shape is None else WrittenShape.of(position.shape, self.reading.robot)
            if isinstance(shape, str):
                self.reading.leave(line, f"{where}: {shape}")
                return
            slots = [n.slot(MM, tg.MM_DECIMALS) for n in position.pose[:3]]
            slots += [n.slot(DEG, tg.DEG_DECIMALS) for n in position.pose[3:]]
            words = read_only(np.array([n.value for n in position.pose[3:]]) * DEG)
            T_BT = self._matrix(position.pose)
            target = tg.CartesianTarget(T_BT, self.language.rotation, words, T_WB, T_FT, shape)
            lines = tuple(u.follows for u in pose.uses if u.linear and u.follows is not None and shape)
            self.reading.add(tg.Target(line, tuple(slots), None, target, follows, lines), pose.index)
