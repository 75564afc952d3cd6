"""KUKA KRL: joint targets and poses, with the status, the turn and the frames that go with them."""

import re
from collections.abc import Sequence

import planner.compensation.points as pt
import planner.compensation.targets as tg
import planner.programs.languages.statements as st
from planner.common.units import DEG, MM, read_only
from planner.compensation.arm_shapes import ACCURATE, StatusTurn
from planner.compensation.formats.krl_calls import (
    CIRCLE_ANGLE,
    MORE_THAN_A_MOVE,
    OWN_FRAMES,
    calls_function,
    hidden_target,
    names_given_away,
    names_set_beside,
)
from planner.compensation.formats.krl_frames import FOLLOWED, FrameState, frame_sources
from planner.compensation.formats.krl_values import transform
from planner.programs.dialect import Dialect
from planner.programs.languages.krl import EXTERNAL, POSE_KEYS, Aggregate, Bas, KrlMove, aggregate, parse

_JOINT_TYPES, _POSE_TYPES = ("E6AXIS", "AXIS"), ("E6POS", "POS", "FRAME")
_COMPONENTS = (*POSE_KEYS, "S", "T", *(f"A{i}" for i in range(1, 7)), *EXTERNAL)
_DRIVEN = re.compile(r"\b(E[1-6])(?:\s+(?!-?0*\.?0*(?:E[-+]?\d+)?\s*[,}])[^,}\s]|\s*=(?!=))", re.IGNORECASE)
_HIDDEN = "{} found; targets of moves, and positions with a name of their own, are corrected"
_GLOBAL = "is global: programs of other files may drive to it with another tool or base"
_IS_GLOBAL = re.compile(r"(?:DECL\s+)?(?:CONST\s+)?GLOBAL\b", re.IGNORECASE)
_CONTROLLERS_OWN = re.compile(r"DEFDAT\s+\$", re.IGNORECASE)  # $config.dat: all that it declares is seen everywhere
_DATA_LIST = re.compile(r"DEFDAT\s+\w", re.IGNORECASE)
_SEEN_BY_ALL = re.compile(r"\bPUBLIC\b", re.IGNORECASE)
_HOME = re.compile(r"XHOME\d?")  # that KUKA's own $config.dat declares
_PUT_TOGETHER = "put both halves of the module into one folder, they are corrected together"
_PLAIN = "plain numbers are allowed"
_WHERE_IT_STANDS = ("$AXIS_ACT", "$POS_ACT")  # a move to it moves nothing
_HINT = (
    ": say it by $TOOL, $BASE, BAS (#TOOL,n), BAS (#BASE,n) before the move (outside of IF and loops). For "
    "numbered frames give the controller's $config.dat (--frames). If no line of the file says any, name them "
    "yourself (--tool, --base)"
)
_UNSEEN = "no move of the files drives to {}: tool and base are taken to be those that it was taught with"
Numbers = dict[str, st.PlacedNumber]


def read(text: str, _dialect: Dialect, reading: tg.TargetReading) -> None:
    """Note the targets of one file, declared or written at their move."""
    own, other = list(parse(text)), list(parse(reading.companion))
    data_first = [other, own] if any(isinstance(s, st.Routine) for s in own) else [own, other]
    targets = _KrlTargets(own, other, reading)
    for statements in data_first:
        for statement in statements:
            targets.take(statement, statements is own)
    targets.finish()
    if not reading.companion:
        targets.refuse_half(own)


class _KrlTargets:
    """What a controller knows, statement by statement, as far as the meaning of a target depends on it."""

    def __init__(self, own: Sequence[st.Statement], other: Sequence[st.Statement], reading: tg.TargetReading) -> None:
        statements = [*other, *own]
        self.reading = reading
        self.public = {  # whether all that the file, or its other half, declares is seen by every program
            mine: any(_CONTROLLERS_OWN.match(s.text) for s in half) for mine, half in ((True, own), (False, other))
        }
        self.frames = FrameState(statements, reading.frames)
        said = [*parse(reading.frames.data), *statements]
        self.driven = {axis.upper() for s in said for axis in _DRIVEN.findall(s.text)}  # external axes that move
        self.points = pt.PointTable(reading, "file")
        for name, line in frame_sources(statements).items():
            self.points.compute(name, f"makes a tool or a base (line {line})")
        self.last: int | None = None  # index of the target that the arm comes from, where that is certain
        self.routine = ""
        self.own = True

    def take(self, statement: st.Statement, own: bool) -> None:
        """Process one statement of the file itself, or of the other half of its module."""
        self.own = own
        self._hand_points(statement)
        self._note_hidden_targets(statement, (st.Assignment, KrlMove))
        match statement:
            case KrlMove():
                self._move(statement)
            case Bas():
                self.frames.select(statement)
            case st.Assignment(name=name) if name in FOLLOWED:
                self.frames.assign(statement)
            case st.Assignment():
                self._read_assignment(statement)
            case st.Flow():
                self.last = None
                self.frames.take_aside(statement)
                self.frames.branch(statement)
            case st.Routine() | st.RoutineEnd():
                self.last = None
                self.routine = statement.name if isinstance(statement, st.Routine) else ""
                self.frames.begin_routine(statement)
            case st.Call():
                self._read_call(statement)
            case _:
                self.frames.take_aside(statement)
                if type(statement) is st.Statement:
                    self.last = None

    def finish(self) -> None:
        """Note the positions that are declared by name, with the frames of the moves that use them."""
        self.own = True
        for pose in self.points.finish():
            assert isinstance(pose.value, dict)
            if "A1" in pose.value:
                tool = pt.common_tool(pose.uses, self.frames.default_frames())
                self._joints(pose.line, pose.value, tool, pose.index)
            else:
                self._note_pose(pose, pose.value)

    def refuse_half(self, own: Sequence[st.Statement]) -> None:
        """Refuse one half of a module whose other half is missing, where targets or moves of the program are there."""
        if not any(isinstance(s, st.Routine) for s in own):
            head = next((s for s in own if _DATA_LIST.match(s.text)), None)
            if head is not None and not _SEEN_BY_ALL.search(head.text):
                said = "is the data of a module (.dat), whose program (.src) does not lie beside it"
                self.reading.refuse(head.line, f"'{head.text}' {said}: {_PUT_TOGETHER}")
            return
        elsewhere = {s.name for s in parse(self.reading.frames.data) if isinstance(s, st.Assignment)}
        for name, line in self.points.missing:
            if name not in elsewhere and not _HOME.fullmatch(name) and not self.points.is_computed(name, "is "):
                said = f"{name} is not declared here, and no data of the module (.dat) lie beside it"
                self.reading.refuse(
                    line, f"{said}: {_PUT_TOGETHER}; where $config.dat declares it, give that (--frames)"
                )

    def _note_pose(self, pose: pt.DeclaredPose, value: Numbers) -> None:
        """Note a pose that is declared by name."""
        taught = self.frames.taught_frames(pose.name)
        if (
            not pose.uses
            and taught is not None
            and not any(said.startswith("no move") for _, said in self.reading.notes)
        ):
            self.reading.notes.append((pose.line, _UNSEEN.format(pose.name)))
        frames = pt.common_frames(pose.uses, taught or self.frames.default_frames())
        self._pose(pose.line, value, frames, pose.uses, inherits=False, index=pose.index)

    def _hand_points(self, statement: st.Statement) -> None:
        """A routine or a function may drive to the points that it is given, and may change them."""
        for name in names_set_beside(statement):  # points too that get their numbers further down
            self.points.compute(name, f"is set in line {statement.line} while the program runs")
        for name in names_given_away(statement):
            if self.points.has(name):
                self.points.use(name, 0, pt.Use(self.frames.default_frames(), None, linear=False))
            if self.frames.may_write(statement):
                where = f"line {statement.line}" + ("" if self.own else " of the other half of the module")
                self.points.compute(name, f"is handed to a routine that may change it ({where})")

    def _read_call(self, call: st.Call) -> None:
        """A routine may set other frames and may drive elsewhere."""
        if call.triggered:
            self.frames.take_trigger(call)
        else:
            self.last = None
            self.frames.forget()

    def _leave(self, line: int, sentence: str) -> None:
        self.last = None
        if self.own:
            self.reading.leave(line, sentence)

    def _move(self, move: KrlMove) -> None:
        if calls_function(move):
            self.last = None
            self.frames.forget()
        if pt.is_service_name(self.routine):
            self._leave(move.line, f"{self.routine} {pt.SENTENCE}")
        elif move.relative:
            self._leave(move.line, f"'{move.text}' moves relative to where the arm is: it keeps the correction there")
        elif not move.targets:
            self._leave(move.line, f"'{move.text}' found; a position in braces or the name of one is allowed")
        else:
            linear = "LIN" in move.word or "CIRC" in move.word or move.word == "SPL"
            why, frames = self._doubt(move, linear), self.frames.current_frames()
            if OWN_FRAMES.search(move.rest):
                frames = self.frames.of_move(move.rest)
            for target in move.targets:
                self._target(move, target, (why, why) if why else frames, linear)

    def _doubt(self, move: KrlMove, linear: bool) -> str:
        """Say why a move does not go to where its target says for certain; nothing where it does."""
        if MORE_THAN_A_MOVE.search(move.rest):
            return f"'{move.rest[:60]}' in line {move.line} is no part of a move that is known here"
        if CIRCLE_ANGLE.match(move.rest):
            return f"the angle CA in line {move.line} ends the circle elsewhere than at the point that is written"
        return self.frames.doubt_orientation(move.rest) if linear else ""

    def _target(self, move: KrlMove, target: Aggregate | str, frames: pt.FramePair, linear: bool) -> None:
        use = pt.Use(frames, self.last, linear)
        if isinstance(target, str):
            if self.frames.hides(target):
                self._leave(move.line, f"{target} is a variable of the routine: its value is not in the file")
                return
            if target.startswith("$"):
                if target not in _WHERE_IT_STANDS:
                    self._leave(move.line, f"{target} found: a position that the controller keeps is not in the file")
                self.last = None
                return
            self.last = self.points.use(target, move.line if self.own else 0, use)
        elif not self.own:
            self.last = None
        elif target.numbers is None:
            self._leave(move.line, f"'{target.text}' found; {_PLAIN}")
        elif target.numbers.keys().isdisjoint(POSE_KEYS):
            self.last = self._joints(move.line, target.numbers, frames[0])
        else:
            self.last = self._pose(move.line, target.numbers, frames, [use], inherits=linear)

    def _read_assignment(self, statement: st.Assignment) -> None:
        """Note a position declared with its numbers, or computed; other structures are none of ours."""
        if calls_function(statement):
            self.last = None
            self.frames.forget()
        if not statement.name.startswith("$"):
            self.frames.assign_named_frame(statement)
            if self._declare(statement):
                return
        self._note_hidden_targets(statement)

    def _note_hidden_targets(self, statement: st.Statement, read: tuple[type[st.Statement], ...] = ()) -> None:
        """Leave a target that stands where none is read: in any statement but those of these classes."""
        if not isinstance(statement, read) and (hidden := hidden_target(statement)):
            self._leave(statement.line, _HIDDEN.format(hidden))

    def _declare(self, statement: st.Assignment) -> bool:
        """Read what a name gets, and return whether that is a position with plain numbers, or declared as one."""
        name, kind, line = statement.name, statement.kind, statement.line if self.own else 0
        where = f"line {statement.line}" + ("" if self.own else " of the other half of the module")
        value = aggregate(statement.value, statement.value_start) if statement.value.startswith("{") else None
        keys = value.numbers.keys() if value is not None and value.numbers is not None else set[str]()
        typed = kind in (*_JOINT_TYPES, *_POSE_TYPES)
        whole = not statement.part and value is not None and ("A1" in keys or set(POSE_KEYS) <= keys)
        if value is not None and not statement.part and (whole or (typed and value.numbers is None)):
            sure = kind in (*_JOINT_TYPES, "E6POS", "POS") or "S" in keys or (not kind and "A1" in keys)
            if typed or not kind:
                self.points.declare(pt.DeclaredPose(name, line, value.numbers, sure))
            if "A1" not in keys and (typed or not kind) and self._is_global(statement):
                self.points.compute(name, _GLOBAL)
                if sure:
                    self._leave(statement.line, f"{name} {_GLOBAL}")
            return typed or not kind
        if not kind and (not statement.part or statement.part in _COMPONENTS):
            self.points.compute(name, f"is computed while the program runs ({where})")
        return False

    def _is_global(self, statement: st.Assignment) -> bool:
        """Tell whether programs of other files may drive to a position that is declared here."""
        return statement.kind != "" and (self.public[self.own] or _IS_GLOBAL.match(statement.text) is not None)

    def _has_needed(self, line: int, found: Numbers, needed: Sequence[str], beside: Sequence[str]) -> bool:
        if set(needed) <= found.keys() <= {*needed, *beside, *EXTERNAL}:
            return True
        extra = ", ".join([*beside, "E1 … E6"])
        sentence = f"{', '.join(found)} found; {', '.join(needed)} are needed, {extra} are allowed beside them"
        self._leave(line, sentence)
        return False

    def _joints(self, line: int, found: Numbers, tool: pt.Frame, index: int | None = None) -> int | None:
        axes = self.reading.axes
        if not self._has_needed(line, found, axes, ()):
            return None
        return self.reading.add_joints(line, [found[axis] for axis in axes], index, tool)

    def _pose(
        self,
        line: int,
        found: Numbers,
        frames: pt.FramePair,
        uses: Sequence[pt.Use],
        inherits: bool,
        index: int | None = None,
    ) -> int | None:
        """Note a pose, and return its index; a line or a circle that ``inherits`` keeps the shape of the arm."""
        if not self._has_needed(line, found, POSE_KEYS, ("S", "T")):
            return None
        if len({"S", "T"} & found.keys()) == 1 and not inherits:
            self._leave(line, "S without T, or T without S: which way the arm takes there is not certain")
            return None
        known, configuration = [use.follows for use in uses if use.follows is not None], _configuration(found)
        follows = tuple(known) if len(known) == len(uses) and (configuration is None or inherits) else ()
        configuration = None if follows else configuration
        straight = () if inherits else tuple(u.follows for u in uses if u.linear and u.follows is not None)
        if why := self._why_not(found, frames, is_sure=configuration is not None or bool(follows)):
            self._leave(line, why)
            return None
        T_FT, T_WB = frames
        assert not isinstance(T_FT, str)
        assert not isinstance(T_WB, str)
        slots = [found[k].slot(MM, tg.MM_DECIMALS) for k in "XYZ"] + [
            found[k].slot(DEG, tg.DEG_DECIMALS) for k in "ABC"
        ]
        if configuration is not None:
            slots += [found[k].slot(1.0, 0, aligned=False) for k in "ST"]
        words = read_only([found[k].value * DEG for k in "ABC"])
        T_BT = transform(Aggregate("", found))
        assert T_BT is not None
        pose = tg.CartesianTarget(T_BT, "ZYX", words, T_WB, T_FT, configuration)
        return self.reading.add(tg.Target(line, tuple(slots), None, pose, follows, straight), index)

    def _why_not(self, found: Numbers, frames: pt.FramePair, is_sure: bool) -> str:
        """Say why the file does not say for certain where the arm is to stand; ``is_sure``: in which shape it does."""
        written = _configuration(found)
        if written is not None and written.status & ACCURATE and not self.reading.frames.uncorrected:
            return (
                f"S {written.status} marks a robot with an accuracy model of its own: the correction would count "
                "twice; where that model is switched off, give the cell that says so (--cell)"
            )
        unknown = {name: f for name, f in zip(("tool", "base"), frames, strict=True) if isinstance(f, str)}
        if why := next((f for f in unknown.values() if f), ""):
            return f"where this pose lies is not certain: {why}"
        if unknown:
            return f"the file does not say the {' and '.join(unknown)} of this pose{_HINT}"
        if not is_sure:
            return "the pose says no status and turn (S, T), and the target before it is not certain"
        if unsaid := sorted(self.driven - found.keys()):
            return f"{unsaid[0]} is not said here and keeps its last value, which other lines set"
        external = any(found[k].value != 0.0 for k in EXTERNAL if k in found)
        return tg.EXTERNAL if external else ""


def _configuration(found: Numbers) -> StatusTurn | None:
    return StatusTurn(int(found["S"].value), int(found["T"].value)) if {"S", "T"} <= found.keys() else None
