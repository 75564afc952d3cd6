"""ABB RAPID: joint targets and robtargets, with the confdata, the tools and the work objects that go with them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import planner.compensation.targets as tg
import planner.programs.languages.statements as st
from planner.common.units import MM, Array, read_only
from planner.compensation.arm_shapes import NEAR
from planner.compensation.rotations import pose_matrix
from planner.programs.dialect import Dialect
from planner.programs.languages.rapid import JOINT_TARGET, POSE, ROB_TARGET, UNUSED, Argument, RapidMove, parse
from planner.programs.languages.text import EXPONENT_NUMBER

QUATERNION_DECIMALS = 8
QUARTER = np.pi / 2
_CONFIGURED = (0, 3, 5)  # joints whose quarter turns cf1, cf4, cf6 count
_TOOL = re.compile(rf"\[\s*TRUE\s*,\s*(?P<pose>{POSE})\s*,.*", re.IGNORECASE | re.DOTALL)
_WORK_OBJECT = re.compile(
    rf"\[\s*FALSE\s*,\s*TRUE\s*,\s*,\s*(?P<user>{POSE})\s*,\s*(?P<object>{POSE})\s*\]", re.IGNORECASE
)
_DISPLACED = re.compile(r"\b(ConfJ|ConfL)\s*\\\s*Off\b|\b(PDispOn|PDispSet|EOffsOn|EOffsSet)\b", re.IGNORECASE)


def read(text: str, _dialect: Dialect, reading: tg.TargetReading) -> None:
    """Note the targets of one module, declared or written at their move; refuse points that the program computes."""
    targets = _RapidTargets(reading)
    for statement in parse(reading.frames.data):
        if isinstance(statement, st.Assignment):
            targets.frame(statement)
    for statement in parse(text):
        targets.take(statement)
    targets.finish()


@dataclass(frozen=True)
class ConfData:
    """RAPID's confdata: quarter turns of joints 1, 4 and 6, and the shape of the arm."""

    quarters: tuple[int, int, int]
    cfx: int

    @property
    def shape(self) -> int | None:
        """Number of the arm's shape: cfx counts axis 1, lower arm (in front is 0) and joint 5 from its highest bit."""
        return (self.cfx >> 2) | ((~self.cfx >> 1 & 1) << 1) | (self.cfx & 1) << 2

    def turns(self, q: Array) -> np.ndarray:
        """Return whether joints 1, 4, 6 of q (n, 6) [rad] are in their quarters; at a border either will do."""
        fits = np.ones(q.shape, dtype=bool)
        for joint, quarter in zip(_CONFIGURED, self.quarters, strict=True):
            low = quarter * QUARTER
            fits[:, joint] = (q[:, joint] > low - NEAR) & (q[:, joint] < low + QUARTER + NEAR)
        return fits

    def renewed(self, before: int, after: int, q: Array, q_new: Array) -> tuple[int, ...]:
        """Return cf1, cf4, cf6, cfx with what the correction (6,) [rad] carries over a border."""
        changed = [int(np.floor(q_new[j] / QUARTER) - np.floor(q[j] / QUARTER)) for j in _CONFIGURED]
        flips = before ^ after
        cfx = self.cfx ^ ((flips & 1) << 2 | (flips & 2) | flips >> 2)
        return (*(c + d for c, d in zip(self.quarters, changed, strict=True)), cfx)


class _RapidTargets:
    """Declarations and moves of a module."""

    def __init__(self, reading: tg.TargetReading) -> None:
        self.reading = reading
        self.points = tg.PointTable(reading, "module")
        self.tools: dict[str, Array | None] = {"tool0": np.eye(4)}
        self.objects: dict[str, Array | None] = {"wobj0": np.eye(4)}
        self.displaced: st.Statement | None = None

    def take(self, statement: st.Statement) -> None:
        """Take in one statement."""
        match statement:
            case st.Assignment():
                self._assigned(statement)
            case RapidMove():
                self._move(statement)
            case _ if self.displaced is None and _DISPLACED.search(statement.text):
                self.displaced = statement

    def finish(self) -> None:
        """Note the robtargets, now that all frames are known."""
        self.points.check()
        for pose in self.points.poses.values():
            self._pose(pose)

    def frame(self, declared: st.Assignment) -> bool:
        """Take in a tool or a work object, and return whether it was one."""
        if declared.kind == "tooldata":
            match = _TOOL.fullmatch(declared.value)
            self.tools[declared.name] = None if match is None else _transform(match["pose"])
        elif declared.kind == "wobjdata":
            match = _WORK_OBJECT.fullmatch(declared.value)
            found = None if match is None else _transform(match["user"]) @ _transform(match["object"])
            self.objects[declared.name] = found
        return declared.kind in ("tooldata", "wobjdata")

    def _assigned(self, statement: st.Assignment) -> None:
        name, value, line = statement.name, statement.value, statement.line
        if statement.kind not in ("tooldata", "wobjdata", "jointtarget", "robtarget"):
            self.points.assigned.setdefault(name, line)
        elif self.frame(statement):
            pass
        elif statement.part:
            sentence = f"an array of targets found ({name}{statement.part}); single targets are allowed"
            self.points.declare(name)
            self.reading.refuse(line, sentence)
        elif JOINT_TARGET.fullmatch(value) and statement.kind == "jointtarget":
            self.points.declare(name)
            self._joints(line, value, statement.value_start)
        elif ROB_TARGET.fullmatch(value) and statement.kind == "robtarget":
            self.points.declare(name, tg.DeclaredPose(line, _numbers(value, statement.value_start)))
        else:
            self.points.declare(name)
            self.reading.refuse(line, f"{name} := {value[:60]} found; plain numbers in brackets are allowed")

    def _move(self, move: RapidMove) -> None:
        first = 0
        if move.word.startswith("search"):  # signal, what is found, and then the targets
            first = 2
            found = move.arguments[min(1, len(move.arguments) - 1)]
            self.points.assigned.setdefault(found.text.lower(), move.line)
        last = first + (2 if re.match(r"(move|trigg|search)c", move.word) else 1)
        frames = self._frames_of(move)
        for argument in move.arguments[first:last]:
            self._argument(move.line, argument, frames)

    def _frames_of(self, move: RapidMove) -> tuple[str, str]:
        """Return the names of tool and work object, which the last argument holds."""
        said = next((a.text for a in reversed(move.arguments) if not a.text.startswith("[")), "")
        tool, work_object = re.match(r"\w+", said), re.search(r"\\\s*WObj\s*:=\s*(\w+)", said, re.IGNORECASE)
        return "" if tool is None else tool[0].lower(), "wobj0" if work_object is None else work_object[1].lower()

    def _argument(self, line: int, argument: Argument, frames: tuple[str, str]) -> None:
        value = argument.text
        name = re.fullmatch(r"(\w+)\s*(?:\\\s*NoEOffs|\\\s*ID\s*:=\s*\w+)?", value, re.IGNORECASE)
        if JOINT_TARGET.fullmatch(value):
            self._joints(line, value, argument.start)
        elif ROB_TARGET.fullmatch(value):
            self.points.poses[f"at {argument.start}"] = tg.DeclaredPose(line, _numbers(value, argument.start), [frames])
        elif name:
            self.points.use(name[1].lower(), line, frames)
        else:
            sentence = f"'{value[:60]}' found as a target; a name or plain numbers in brackets are allowed"
            self.reading.refuse(line, sentence)

    def _joints(self, line: int, value: str, start: int) -> None:
        found = _numbers(value, start)[: self.reading.robot.n_joints]
        if any(number.value > UNUSED for number in found):
            sentence = f"an axis without a number (9E9) found; the robot has {len(found)} joints"
            self.reading.refuse(line, sentence)
        else:
            self.reading.add_joints(line, found)

    def _pose(self, declared: tg.DeclaredPose) -> None:
        found: list[st.PlacedNumber] = declared.value
        values = [number.value for number in found]
        conf = [round(v) for v in values[7:11]]
        T_FT, T_WB = self._known_frames(declared)
        refusal = self._refusal(values, conf)
        if refusal is None and (T_FT is None or T_WB is None):
            names = ", ".join(sorted({f"{t} and {w}" for t, w in declared.frames})) or "no move of this file"
            refusal = (
                f"tool and work object of this target are not known ({names}): declare them in the module, give a "
                "module that does (--frames), or name them yourself (--tool, --base)"
            )
        if refusal is not None or T_FT is None or T_WB is None:
            self.reading.refuse(declared.line, refusal or "")
            return
        if any(v < UNUSED for v in values[11:]):
            self.reading.notes.append((declared.line, tg.EXTERNAL_NOTE))
        units = [(MM, tg.MM_DECIMALS)] * 3 + [(1.0, QUATERNION_DECIMALS)] * 4 + [(1.0, 0)] * 4
        slots = tuple(number.slot(*unit) for number, unit in zip(found, units, strict=False))
        configuration = ConfData((conf[0], conf[1], conf[2]), conf[3])
        words = read_only(values[3:7])
        pose = tg.CartesianTarget(_pose_of(values), "quaternion", words, T_WB, T_FT, configuration)
        self.reading.targets.append(tg.Target(declared.line, slots, pose=pose))

    def _refusal(self, values: list[float], conf: list[int]) -> str | None:
        size = float(np.linalg.norm(values[3:7]))
        if abs(size - 1.0) > 1e-3:
            return f"the quaternion has the length {size:.4f}; 1 is allowed"
        if not 0 <= conf[3] <= 3:
            return f"cfx = {conf[3]} found; 0 … 3 are allowed (the wrist in front of axis 1), or a jointtarget"
        if self.displaced is not None:
            word = _DISPLACED.search(self.displaced.text)
            assert word is not None
            return f"{word[0]} in line {self.displaced.line} makes the meaning of this target uncertain"
        return None

    def _known_frames(self, declared: tg.DeclaredPose) -> tg.FramePair:
        given = self.reading.frames
        frames = [(self.tools.get(t, given.T_FT), self.objects.get(w, given.T_WB)) for t, w in declared.frames]
        return tg.common_frames(frames) if frames else (given.T_FT, given.T_WB)


def _numbers(value: str, start: int) -> list[st.PlacedNumber]:
    return st.placed_numbers(value, start, EXPONENT_NUMBER)


def _transform(pose: str) -> Array:
    return _pose_of([number.value for number in _numbers(pose, 0)])


def _pose_of(values: Sequence[float]) -> Array:
    """Return the transform (4, 4) [m] of x, y, z [mm] and a quaternion."""
    return pose_matrix(np.array(values[:3]) * MM, np.array(values[3:7]))
