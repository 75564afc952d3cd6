"""From the neutral program to the steps that a template prints: words chosen, numbers rounded."""

import unicodedata
from dataclasses import dataclass
from typing import Literal, assert_never

from planner.errors import InputError
from planner.program.blends import blend_values
from planner.program.dialect import Comment as CommentStyle
from planner.program.dialect import Dialect
from planner.program.instructions import (
    Comment,
    Dwell,
    Instruction,
    JointMove,
    LogAxes,
    Pause,
    Program,
    Section,
    Sync,
    WaitInput,
)
from planner.program.numbers import fixed
from planner.program.speeds import overrides, speed_value


@dataclass(frozen=True)
class Move:
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
    sync: int | None
    """Pose marked in passing, where the dialect says so together with the move."""
    pose: int | None


Kind = Literal["move", "dwell", "sync", "sync_on", "sync_off", "log", "pause", "wait", "comment", "section", "override"]


@dataclass(frozen=True)
class Step:
    """One step of a template: its kind, and what the kind needs."""

    kind: Kind
    text: str = ""
    number: int = 0
    row: int = 0
    seconds: float = 0.0
    move: Move | None = None


def plain(text: str, style: CommentStyle) -> str:
    """Return ``text`` on one line, in ASCII, without the characters that would end a comment."""
    ascii_text = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    kept = "".join(" " if c in style.forbid or not c.isprintable() else c for c in ascii_text)
    return " ".join(kept.split())[: style.max_length].rstrip()


def lower(program: Program, dialect: Dialect) -> tuple[Step, ...]:
    """Return the steps of ``program`` in ``dialect``.

    Raises:
        InputError: the dialect has too few or too many axes, or cannot say a speed or a mark.
    """
    if not dialect.min_joints <= program.n_joints <= dialect.max_joints:
        raise InputError(
            f"{dialect.title} carries {dialect.min_joints} to {dialect.max_joints} joints, "
            f"{program.robot} has {program.n_joints}"
        )
    return tuple(_Lowering(program, dialect).steps)


class _Lowering:
    """Walks the instructions once; remembers what the controller would."""

    def __init__(self, program: Program, dialect: Dialect) -> None:
        self.dialect = dialect
        self.blends = blend_values(program.home_deg, program.moves, dialect.blend)
        self.overrides = overrides(program.moves, dialect.speed)
        self.steps: list[Step] = []
        self.moves = self.rows = 0
        self.override = 100
        self.here = program.home_deg
        self.last_blend: str | None = None
        self.last_speed = ""
        self.flying = self.pulse_open = False
        for item, following in zip(program.instructions, _followers(program.instructions), strict=True):
            self._add(item, following)
        self._set_override(100)

    def _add(self, item: Instruction, following: Instruction | None) -> None:
        style = self.dialect.comment
        match item:
            case JointMove():
                self._move(item, following)
            case Dwell(seconds=seconds):
                self.steps.append(Step("dwell", seconds=seconds))
            case Sync(pose=pose):
                self._sync(pose)
            case LogAxes(pose=pose):
                self.rows += 1
                self.steps.append(Step("log", number=pose, row=self.rows))
            case Pause(message=text):
                self.steps.append(Step("pause", text=plain(text, style)))
            case WaitInput(what=text):
                self.steps.append(Step("wait", text=plain(text, style), number=len(self.steps)))
            case Comment(text=text):
                self.steps.append(Step("comment", text=plain(text, style)))
            case Section(name=text):
                self.steps.append(Step("section", text=plain(text, style)))
            case _:
                assert_never(item)

    def _set_override(self, override: int) -> None:
        if override != self.override:
            self.override = override
            self.last_speed = ""
            self.steps.append(Step("override", number=override))

    def _move(self, item: JointMove, following: Instruction | None) -> None:
        if not self.flying:
            self._set_override(self.overrides[self.moves])
        move = self._printed(item, self.blends[self.moves], following)
        self.steps.append(Step("move", move=move))
        self.moves += 1
        self.here, self.flying = item.q_deg, not move.exact
        self.last_blend, self.last_speed = move.blend, move.speed
        if self.pulse_open:
            self.pulse_open = False
            self.steps.append(Step("sync_off"))
            if self.flying and isinstance(following, Sync):
                raise InputError(
                    f"{self.dialect.title} cannot pulse at two points one after the other; put a support "
                    f"point before pose {following.pose}"
                )

    def _printed(self, item: JointMove, value: float | None, following: Instruction | None) -> Move:
        d = self.dialect
        blend = "" if value is None else fixed(value, d.blend.decimals)
        if d.blend.kind == "dense" and value is not None:
            blend = d.blend.tolerance
        speed = fixed(speed_value(item, self.override, d.speed), d.speed.decimals)
        with_move = value is not None and d.sync.flying == "with_move"
        turned = sum(abs(b - a) for a, b in zip(self.here, item.q_deg, strict=True))
        return Move(
            words=tuple(zip(d.axes, (fixed(q, d.decimals) for q in item.q_deg), strict=False)),
            exact=value is None,
            blend=blend,
            blend_changed=blend != self.last_blend,
            speed=speed,
            speed_changed=speed != self.last_speed,
            turn_deg_s=turned / item.duration_s,
            approach=self.moves == 0,
            sync=following.pose if with_move and isinstance(following, Sync) else None,
            pose=item.pose,
        )

    def _sync(self, pose: int) -> None:
        if not self.flying:
            self.steps.append(Step("sync", number=pose))
        elif self.dialect.sync.flying == "after":
            self.steps.append(Step("sync_on", number=pose))
            self.pulse_open = bool(self.dialect.sync.flying_off)


def _followers(instructions: tuple[Instruction, ...]) -> list[Instruction | None]:
    """Return for each instruction the next one that makes the robot do something."""
    following: Instruction | None = None
    ahead: list[Instruction | None] = []
    for item in reversed(instructions):
        ahead.append(following)
        following = following if isinstance(item, Comment | Section) else item
    return ahead[::-1]
