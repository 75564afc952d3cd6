"""KUKA KRL: joint targets and poses, with the status, the turn and the frames that go with them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import planner.compensation.targets as tg
import planner.programs.languages.statements as st
from planner.common.units import DEG, MM, Array, read_only
from planner.compensation.arm_shapes import NEAR
from planner.compensation.rotations import frame, from_abc
from planner.programs.dialect import Dialect
from planner.programs.languages.krl import EXTERNAL, POSE_KEYS, Aggregate, Bas, KrlMove, aggregate, parse

ACCURATE = 16  # status bit of a point that was taught on a robot with an accuracy model of its own
_JOINT_TYPES, _POSE_TYPES = ("E6AXIS", "AXIS"), ("E6POS", "POS")
_COMPONENTS = (*POSE_KEYS, *(f"A{i}" for i in range(1, 7)))
_TABLE = re.compile(r"(TOOL|BASE)_DATA\[\s*(\d+)\s*\]")
_RESETS_FRAMES = ("INITMOV", "FRAMES", "EX_BASE", "BASE_TCP", "TCP_IPO", "EX_TOOL")
_HINT = (
    ": say it by $TOOL, $BASE, BAS (#TOOL,n), BAS (#BASE,n) before the move (outside of IF and loops), give the "
    "controller's $config.dat for numbered frames (--frames), or name them yourself (--tool, --base)"
)
Numbers = dict[str, st.PlacedNumber]


def read(text: str, _dialect: Dialect, reading: tg.TargetReading) -> None:
    """Note the targets of one file, declared or written at their move; refuse points that the program computes."""
    statements = list(parse(text))
    targets = _KrlTargets(statements, reading)
    for statement in statements:
        targets.take(statement)
    targets.finish()


@dataclass(frozen=True)
class StatusTurn:
    """KUKA's status and turn: the shape of the arm, and a bit for each joint that is negative."""

    status: int
    turn: int

    @property
    def shape(self) -> int | None:
        """Number of the arm's shape: bits 0 and 1 are KUKA's own; the sign of A5 is taken from the turn.

        Manuals differ about the sense of status bit 2, none about the turn's.
        """
        return (self.status & 3) | (self.turn >> 4 & 1) << 2

    def turns(self, q: Array) -> np.ndarray:
        """Return whether the joints q (n, N) [rad] have the signs that are said; near zero either will do."""
        negative = (self.turn >> np.arange(q.shape[1])) & 1
        return np.asarray((np.abs(q) < NEAR) | ((q < 0) == (negative == 1)))

    def renewed(self, before: int, after: int, q: Array, q_new: Array) -> tuple[int, ...]:
        """Return status and turn, with the bits changed whose sign the correction (N,) [rad] has changed."""
        crossed = (q < 0) != (q_new < 0)
        return self.status ^ (before ^ after), self.turn ^ int(crossed @ (1 << np.arange(len(q))))


def _transform(found: Aggregate | None) -> Array | None:
    """Return the transform (4, 4) [m] of a value with X, Y, Z, A, B, C, else None."""
    numbers = {} if found is None else found.numbers or {}
    if not set(POSE_KEYS) <= numbers.keys():
        return None
    values = np.array([numbers[key].value for key in POSE_KEYS])
    return read_only(frame(values[None, :3] * MM, from_abc(values[None, 3:] * DEG))[0])


class _FrameState:
    """Tool and base as they stand at a statement; None where the file does not say them for certain."""

    def __init__(self, statements: Sequence[st.Statement], reading: tg.TargetReading) -> None:
        self.given: tg.FramePair = reading.frames.T_FT, reading.frames.T_WB
        self._tables: dict[tuple[str, int], Array] = {("TOOL", 0): np.eye(4), ("BASE", 0): np.eye(4)}
        for statement in (*parse(reading.frames.data), *statements):
            if isinstance(statement, st.Assignment) and (match := _TABLE.fullmatch(statement.name)):
                T = _transform(aggregate(statement.value, 0))
                if T is not None:
                    self._tables[match[1], int(match[2])] = T
        taught = (s for s in statements if isinstance(s, st.Assignment) and s.kind == "FDAT")
        self._taught = {s.name[1:]: s.value.upper() for s in taught if s.name.startswith("F")}
        self.forget()

    def forget(self) -> None:
        """Forget what was set: another program may have set something else."""
        self._now: dict[str, Array | None] = {"TOOL": None, "BASE": None}
        self._depth, self._doubtful = 0, False

    def now(self) -> tg.FramePair:
        """Return tool and base at this statement."""
        return self.given if self._doubtful else self._or_given(self._now["TOOL"], self._now["BASE"])

    def _or_given(self, tool: Array | None, base: Array | None) -> tg.FramePair:
        return self.given[0] if tool is None else tool, self.given[1] if base is None else base

    def of_point(self, name: str) -> tg.FramePair | None:
        """Return tool and base of a point taught by inline form: XP1 goes with FP1; None where it has no FDAT."""
        data = self._taught.get(name[1:]) if name.startswith("X") else None
        if data is None:
            return None
        numbers = dict(re.findall(r"\b(TOOL|BASE)_NO\s+(-?\d+)", data))
        if re.search(r"IPO_FRAME\s+#TCP", data) or len(numbers) != 2:
            return None, None
        tool, base = (self._tables.get((which, int(numbers[which]))) for which in ("TOOL", "BASE"))
        return self._or_given(tool, base)

    def branch(self, depth: int) -> None:
        """Count how deep in IF and loops the next statement is."""
        self._depth += depth

    def select(self, statement: Bas) -> None:
        """Take in a call of BAS that selects frames by number, or forgets them."""
        if statement.what in self._now:
            index = statement.value
            self._set(statement.what, self._tables.get((statement.what, int(index))) if index.isdigit() else None)
        elif statement.what in _RESETS_FRAMES:
            self._set("TOOL", None)
            self._set("BASE", None)

    def assign(self, statement: st.Assignment) -> None:
        """Take in ``$TOOL = …`` or ``$BASE = …``."""
        value = statement.value
        if value.upper() == "$NULLFRAME":
            T: Array | None = np.eye(4)
        elif match := _TABLE.fullmatch(value.upper()):
            T = self._tables.get((match[1], int(match[2])))
        else:
            T = _transform(aggregate(value, 0)) if value.startswith("{") and value.endswith("}") else None
        self._set(statement.name[1:], T)

    def _set(self, which: str, T: Array | None) -> None:
        self._now[which] = T
        self._doubtful |= self._depth > 0


class _KrlTargets:
    """What a controller knows, statement by statement, as far as the meaning of a target depends on it."""

    def __init__(self, statements: Sequence[st.Statement], reading: tg.TargetReading) -> None:
        self.reading = reading
        self.frames = _FrameState(statements, reading)
        self.points = tg.PointTable(reading, "file")
        self.last: int | None = None  # index of the target that the arm comes from, where that is certain

    def take(self, statement: st.Statement) -> None:
        """Take in one statement."""
        match statement:
            case KrlMove():
                self._move(statement)
            case Bas():
                self.frames.select(statement)
            case st.Assignment(name="$TOOL" | "$BASE", part=""):
                self.frames.assign(statement)
            case st.Assignment():
                self._assigned(statement)
            case st.Flow(depth=depth):
                self.last = None
                self.frames.branch(depth)
            case st.Routine() | st.RoutineEnd() | st.Call(triggered=False):
                self.last = None
                self.frames.forget()

    def finish(self) -> None:
        """Note the poses that are declared by name, with the frames of the moves that use them."""
        self.points.check()
        for name, pose in self.points.poses.items():
            frames = self.frames.of_point(name) or (tg.common_frames(pose.frames) if pose.frames else self.frames.given)
            self._pose(pose.line, pose.value, frames, inherits=False)

    def _move(self, move: KrlMove) -> None:
        if move.relative:
            sentence = f"'{move.text}' moves relative to where the arm is; absolute targets are allowed"
            self.reading.refuse(move.line, sentence)
        elif not move.targets:
            sentence = f"'{move.text}' found; a position in braces or the name of one is allowed"
            self.reading.refuse(move.line, sentence)
        for target in move.targets if not move.relative else ():
            if isinstance(target, str):
                self.last = None
                if not target.startswith("$"):
                    self.points.use(target, move.line, self.frames.now())
            elif target.numbers is None:
                self.reading.refuse(move.line, f"'{target.text}' found; plain numbers are allowed")
            elif target.numbers.keys().isdisjoint(POSE_KEYS):
                self._joints(move.line, target.numbers)
            else:
                self._pose(move.line, target.numbers, self.frames.now(), inherits=move.word not in ("PTP", "SPTP"))

    def _assigned(self, statement: st.Assignment) -> None:
        """Note a position declared with its numbers, or computed; other structures are none of ours."""
        name, kind, line = statement.name, statement.kind, statement.line
        if statement.part or not statement.value.startswith("{"):
            if not kind and (not statement.part or statement.part in _COMPONENTS):
                self.points.assigned.setdefault(name, line)
            return
        value = aggregate(statement.value, statement.value_start)
        numbers = value.numbers
        if numbers is None:
            if kind in (*_JOINT_TYPES, *_POSE_TYPES):
                self.reading.refuse(line, f"'{value.text}' found; plain numbers are allowed")
        elif kind in ("", *_JOINT_TYPES) and set(self.reading.axes) <= numbers.keys():
            self.points.declare(name)
            self._joints(line, numbers)
        elif kind in ("", *_POSE_TYPES) and set(POSE_KEYS) <= numbers.keys() and not name.startswith("$"):
            if not kind and "S" not in numbers:
                return
            if name in self.points.declared:
                self.reading.refuse(line, f"{name} has more than one value in this file")
            self.points.declare(name, tg.DeclaredPose(line, numbers))
        elif kind in (*_JOINT_TYPES, *_POSE_TYPES):
            self._joints(line, numbers) if "A1" in numbers else self._pose(line, numbers, (None, None), inherits=False)

    def _complete(self, line: int, found: Numbers, needed: Sequence[str], beside: Sequence[str]) -> bool:
        if set(needed) <= found.keys() <= {*needed, *beside, *EXTERNAL}:
            return True
        extra = ", ".join([*beside, "E1 … E6"])
        sentence = f"{', '.join(found)} found; {', '.join(needed)} are needed, {extra} are allowed beside them"
        self.reading.refuse(line, sentence)
        return False

    def _joints(self, line: int, found: Numbers) -> None:
        axes = self.reading.axes
        if self._complete(line, found, axes, ()):
            self.last = len(self.reading.targets)
            self.reading.add_joints(line, [found[axis] for axis in axes])

    def _pose(self, line: int, found: Numbers, frames: tg.FramePair, inherits: bool) -> None:
        if not self._complete(line, found, POSE_KEYS, ("S", "T")):
            return
        T_FT, T_WB = frames
        if T_FT is None or T_WB is None:
            lost = " and ".join(name for name, T in (("tool", T_FT), ("base", T_WB)) if T is None)
            self.reading.refuse(line, f"the file does not say the {lost} of this pose{_HINT}")
            return
        configuration, follows = self._configuration(line, found), None
        if (configuration is None or inherits) and self.last is not None:
            configuration, follows = None, self.last
        if configuration is None and follows is None:
            sentence = "the pose says no status and turn (S, T), and the target before it is not certain"
            self.reading.refuse(line, sentence)
            return
        slots = [found[k].slot(MM, tg.MM_DECIMALS) for k in "XYZ"] + [
            found[k].slot(DEG, tg.DEG_DECIMALS) for k in "ABC"
        ]
        if configuration is not None:
            slots += [found[k].slot(1.0, 0, aligned=False) for k in "ST"]
        words = read_only([found[k].value * DEG for k in "ABC"])
        if any(found[k].value != 0.0 for k in EXTERNAL if k in found):
            self.reading.notes.append((line, tg.EXTERNAL_NOTE))
        T_BT = _transform(Aggregate("", found))
        assert T_BT is not None
        pose = tg.CartesianTarget(T_BT, "abc", words, T_WB, T_FT, configuration)
        self.last = len(self.reading.targets)
        self.reading.targets.append(tg.Target(line, tuple(slots), pose=pose, follows=follows))

    def _configuration(self, line: int, found: Numbers) -> StatusTurn | None:
        if "S" not in found or "T" not in found:
            return None
        status = StatusTurn(int(found["S"].value), int(found["T"].value))
        if status.status & ACCURATE:
            sentence = (
                f"S {status.status} marks a robot with an accuracy model of its own: the correction would count twice"
            )
            self.reading.refuse(line, sentence)
        return status
