"""From the neutral program to the steps that a template prints: words chosen, numbers rounded, poses marked."""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from operator import mul
from typing import Literal, assert_never

import planner.programs.instructions as ins
from planner.common.advice import Occasion, advice
from planner.common.errors import InputError
from planner.programs.dialect import Dialect, comment_text, plain_text
from planner.programs.motion_words import blend_values, choose_reductions, format_fixed_point, round_down, speed_value
from planner.programs.streams import TimedLeg, time_legs


@dataclass(frozen=True)
class PoseMark:
    """What the instructions between a move and the next want of the pose that the move ends at."""

    sync: int | None = None
    log: int | None = None

    @property
    def pose(self) -> int | None:
        """Return the pose that is marked, if one is."""
        return self.sync if self.sync is not None else self.log


def find_marks(instructions: tuple[ins.Instruction, ...]) -> list[PoseMark]:
    """Return for each move what is wanted of the pose that it ends at."""
    marks: list[PoseMark] = []
    for item in instructions:
        if isinstance(item, ins.JointMove):
            marks.append(PoseMark())
        elif isinstance(item, ins.Sync) and marks and marks[-1].sync is None:
            marks[-1] = replace(marks[-1], sync=item.pose)
        elif isinstance(item, ins.LogAxes) and marks and marks[-1].log is None:
            marks[-1] = replace(marks[-1], log=item.pose)
    return marks


@dataclass(frozen=True)
class MoveWords:
    """One joint move as a template sees it; every number is text, ready to print."""

    words: tuple[tuple[str, str], ...]
    """(axis name, angle) pairs."""
    exact: bool
    blend: str
    blend_changed: bool
    speed: str
    speed_changed: bool
    turn_deg_s: float
    """Sum of the axes' mean speeds [deg/s]: no direction of the tool turns faster at the planned time."""
    approach: bool
    """True for the first move, which starts wherever the robot happens to stand."""
    reduction: int
    """The program's own coarse reduction that ``speed`` is a part of [%]."""
    sync: int | None
    """Pose marked in passing, where the dialect says so together with the move."""
    pose: int | None
    pulse: bool = False
    """Whether the mark in passing pulses the output."""
    log: bool = False
    """Whether the mark in passing records the axes."""
    via: tuple[tuple[str, str], ...] = ()
    """(axis name, angle) pairs of the middle point of a circle of the tool."""
    radians: tuple[str, ...] = ()
    radians_s: tuple[str, ...] = ()
    """Velocities at the end, of a stream that says them [rad/s]."""
    frames: tuple[str, ...] = ()
    """Angles of the frames inside the leg, separated by commas, of a stream in frames [deg]."""
    number: int = 0
    """Counts the moves from 1, ways to later starts among them."""


Kind = Literal[
    "move", "dwell", "sync", "sync_on", "sync_off", "log", "log_passing", "unlogged",
    "centre", "pause", "wait", "comment", "section", "reduction", "stretch", "entry", "end",
]  # fmt: skip
WITH_TEXT: dict[type, Kind] = {ins.Comment: "comment", ins.Section: "section", ins.Pause: "pause"}


@dataclass(frozen=True)
class ProgramStep:
    """One step of a template: its kind, and what the kind needs."""

    kind: Kind
    text: str = ""
    number: int = 0
    row: int = 0
    seconds: float = 0.0
    move: MoveWords | None = None
    pulse: bool = False
    log: bool = False
    until: int = 0


UNKNOWN_REDUCTION = 0  # one that depends on where the operator has started


def lower_program(program: ins.Program, dialect: Dialect) -> tuple[ProgramStep, ...]:
    """Return the steps of ``program`` in ``dialect``.

    Raises:
        InputError: the dialect has too few or too many axes, or cannot say a speed or a mark.
    """
    if not dialect.min_joints <= program.n_joints <= dialect.max_joints:
        raise InputError(
            f"{dialect.title} carries {dialect.min_joints} to {dialect.max_joints} joints, "
            f"{program.robot} has {program.n_joints}"
        )
    return tuple(_StepBuilder(program, dialect).steps)


class _StepBuilder:
    """Walks the instructions once; remembers what the controller would."""

    def __init__(self, program: ins.Program, dialect: Dialect) -> None:
        self.program, self.dialect = program, dialect
        self.pulses = program.controller.sync_output is not None and bool(dialect.sync.rest)
        self.waits = program.controller.gauge_input is not None
        self.blends = blend_values(program.home_deg, program.moves, dialect.blend)
        self.reductions = choose_reductions(program.moves, dialect.speed)
        stops, limits = [b is None for b in self.blends], program.acceleration_deg_s2
        self.stream = (
            time_legs(program.home_deg, program.moves, stops, dialect.speed, limits) if dialect.speed.stream else ()
        )
        self.steps: list[ProgramStep] = []
        self.moves = self.rows = self.printed = 0
        self.reduction = 100
        self.here = program.home_deg
        self.last_blend: str | None = None
        self.last_speed = ""
        self.flying = self.pulse_open = False
        ways = [r for e in program.entries for r in choose_reductions(e.moves, dialect.speed)]
        self.scaled = any(r != 100 for r in (*self.reductions, *ways))
        self.branch = 0
        self.marks = find_marks(program.instructions)
        for item in program.instructions:
            self._add(item)
        if self.scaled:
            self._set_reduction(100)

    def _add(self, item: ins.Instruction) -> None:
        match item:
            case ins.JointMove():
                self._move(item)
            case ins.Dwell(seconds=seconds):
                self.steps.append(ProgramStep("dwell", seconds=seconds))
            case ins.Sync() | ins.LogAxes() if self.flying:
                pass  # told with the move
            case ins.Comment(text=text) | ins.Section(name=text) | ins.Pause(message=text):
                kind: Kind = WITH_TEXT[type(item)]
                self.steps.append(
                    ProgramStep(kind, text=self._person_text(text) if kind == "pause" else self._text(text))
                )
            case ins.StretchBegin(until=until):
                self._begin_stretch(until)
            case ins.StretchEnd():
                self.steps.append(ProgramStep("end", number=self.branch))
            case ins.Entry():
                self._enter(item)
            case _:
                self._add_signal(item)

    def _add_signal(self, item: ins.Sync | ins.LogAxes | ins.Centre | ins.WaitInput) -> None:
        match item:
            case ins.Sync(pose=pose):
                self.steps.append(
                    ProgramStep("sync", number=pose) if self.pulses else ProgramStep("comment", text=f"pose {pose}")
                )
            case ins.LogAxes(pose=pose):
                self._log("log", pose)
            case ins.Centre(ball=ball, pose=pose):
                self.steps.append(ProgramStep("centre", text=self._centring(ball, pose)))
                self.last_speed = ""  # the routine drives at speeds of its own
            case ins.WaitInput(what=text):
                self._wait(text)
            case _:
                assert_never(item)

    def _centring(self, ball: int, pose: int) -> str:
        if self.dialect.centre is None:
            raise InputError(
                f"{self.dialect.title} has no call of a centring routine, which a plan with an artifact's balls needs; "
                f"take a dialect with one (krl){advice(Occasion.NO_CENTRING_CALL)}"
            )
        return self.dialect.centre.call.format(ball=ball, pose=pose)

    def _begin_stretch(self, until: int) -> None:
        """What came before may have been left out: every word is said anew."""
        self._begin_branch("stretch", until)
        self.last_speed, self.last_blend = "", None
        if not self.flying and self.scaled:
            self.reduction = UNKNOWN_REDUCTION

    def _begin_branch(self, kind: Literal["stretch", "entry"], number: int) -> None:
        self.branch = len(self.steps) + 1
        self.steps.append(ProgramStep(kind, number=self.branch, row=self.rows, until=number))

    def _enter(self, entry: ins.Entry) -> None:
        """The way to a start: exact stops, and then the reduction that the path goes on with."""
        self._begin_branch("entry", entry.at)
        reduction, here = self.reduction, self.here
        self.reduction, self.here = UNKNOWN_REDUCTION if self.scaled else reduction, entry.origin_deg
        for move, wanted in zip(entry.moves, choose_reductions(entry.moves, self.dialect.speed), strict=True):
            self._set_reduction(wanted)
            self.last_speed, self.last_blend = "", None
            self.steps.append(ProgramStep("move", move=self._print_move(move, None, PoseMark())))
            self.here = move.q_deg
        self._set_reduction(reduction)
        self.reduction, self.here = reduction, here
        self.steps.append(ProgramStep("end", number=self.branch))

    def _set_reduction(self, reduction: int) -> None:
        if reduction not in (self.reduction, UNKNOWN_REDUCTION):
            self.reduction = reduction
            self.last_speed = ""
            self.steps.append(ProgramStep("reduction", number=reduction))

    def _log(self, kind: Literal["log", "log_passing"], pose: int) -> None:
        self.rows += 1
        self.steps.append(ProgramStep(kind, number=pose, row=self.rows))

    def _wait(self, what: str) -> None:
        """Without an input the operator alone goes on, at the pause before or at one of its own."""
        if self.waits:
            self.steps.append(ProgramStep("wait", text=self._text(what), number=len(self.steps)))
        elif not self.steps or self.steps[-1].kind != "pause":
            self.steps.append(ProgramStep("pause", text=self._person_text(what)))
        else:
            said = f"{self._text(what)}: no input is waited for, the operator goes on"
            self.steps.append(ProgramStep("comment", text=said))

    def _text(self, text: str) -> str:
        return comment_text(text, self.dialect.comment)

    def _person_text(self, text: str) -> str:
        """Return what the pendant tells a person, with what lets the program go on where there is room for it."""
        asked = plain_text(f"{text}, then {self.dialect.go_on}", self.dialect.comment)
        return asked if len(asked) <= self.dialect.comment.max_length else self._text(text)

    def _move(self, item: ins.JointMove) -> None:
        mark = self.marks[self.moves]
        if not self.flying:
            self._set_reduction(self.reductions[self.moves])
        move = self._print_move(item, self.blends[self.moves], mark)
        self.steps.append(ProgramStep("move", move=move))
        self.moves += 1
        self.here, self.flying = item.q_deg, not move.exact
        self.last_blend, self.last_speed = (None, "") if move.via else (move.blend, move.speed)
        if self.pulse_open:
            self.pulse_open = False
            self.steps.append(ProgramStep("sync_off"))
            if self.flying and mark.sync is not None:
                raise InputError(
                    f"{self.dialect.title} cannot pulse at two points one after the other; put a support "
                    f"point before pose {mark.sync}"
                )
        if self.flying:
            self._passing_steps(mark)

    def _print_move(self, item: ins.JointMove, value: float | None, mark: PoseMark) -> MoveWords:
        d = self.dialect
        blend = "" if value is None else format_fixed_point(value, d.blend.decimals)
        points = [self.here, *([] if item.via_deg is None else [item.via_deg]), item.q_deg]
        if d.blend.kind == "dense" and value is not None:
            blend = d.blend.tolerance
        leg = self.stream[self.moves] if self.stream else TimedLeg(0.0, ())
        seconds = speed_value(item, self.reduction, d.speed, self.here, value is None)
        speed = format_fixed_point(leg.seconds if self.stream else seconds, d.speed.decimals)
        if item.via_deg is not None:
            blend, speed = self._circle_words(item)
        with_move = value is not None and d.sync.flying == "with_move"
        pulse, log = self._signals(mark) if value is not None else (False, False)
        turning = [k for k in range(self.program.n_joints) if not self.program.slides(k)]
        turned = sum(abs(q[k] - p[k]) for p, q in pairwise(points) for k in turning)
        self.printed += 1
        return MoveWords(
            words=self._words(item.q_deg),
            exact=value is None,
            blend=blend,
            blend_changed=blend != self.last_blend,
            speed=speed,
            speed_changed=speed != self.last_speed,
            turn_deg_s=turned / item.duration_s,
            approach=self.moves == 0,
            reduction=self.reduction,
            sync=mark.pose if with_move else None,
            pose=item.pose,
            pulse=pulse,
            log=log,
            via=() if item.via_deg is None else self._words(item.via_deg),
            radians=self._si(item.q_deg),
            radians_s=self._si(leg.velocity_deg_s),
            frames=tuple(",".join(format_fixed_point(q, d.decimals) for q in frame) for frame in leg.frames_deg),
            number=self.printed,
        )

    def _si(self, values: tuple[float, ...]) -> tuple[str, ...]:
        """Return degrees as radians, and millimetres of axes that slide as metres."""
        si = (v / 1e3 if self.program.slides(k) else math.radians(v) for k, v in enumerate(values))
        return tuple(format_fixed_point(v, 7) for v in si)  # decimals: 0.1 µrad or 0.1 µm

    def _words(self, q_deg: tuple[float, ...]) -> tuple[tuple[str, str], ...]:
        counts = q_deg if not self.dialect.pulses else map(mul, q_deg, self.program.pulses_per_deg)
        return tuple(
            zip(self.dialect.axes, (format_fixed_point(q, self.dialect.decimals) for q in counts), strict=False)
        )

    def _circle_words(self, item: ins.JointMove) -> tuple[str, str]:
        """Return rounding and speed of a piece of a circle."""
        style = self.dialect.circle
        if style is None or len(item.q_deg) != style.n_joints:
            raise InputError(f"{self.dialect.title} cannot say a circle of the tool for {len(item.q_deg)} joints")
        speed = format_fixed_point(round_down(item.tool_speed_mm_s / style.mm_s, style.decimals), style.decimals)
        return ("" if item.blend_mm == 0.0 else format_fixed_point(item.blend_mm, style.blend_decimals)), speed

    def _signals(self, mark: PoseMark) -> tuple[bool, bool]:
        """Whether a mark in passing pulses the output, and whether it records the axes."""
        return self.pulses and mark.sync is not None, self.dialect.logs_passing and mark.log is not None

    def _passing_steps(self, mark: PoseMark) -> None:
        """The steps of a pose that the robot has just driven through."""
        pose, (pulse, log) = mark.pose, self._signals(mark)
        if pose is None:
            return
        if self.dialect.sync.flying == "after":
            if pulse or log:
                self.steps.append(ProgramStep("sync_on", number=pose, pulse=pulse, log=log))
                self.pulse_open = pulse and bool(self.dialect.sync.flying_off)
            else:
                self.steps.append(ProgramStep("comment", text=f"pose {pose} in passing"))
        if log:
            self._log("log_passing", pose)
        elif mark.log is not None:
            self.steps.append(ProgramStep("unlogged", number=pose))
