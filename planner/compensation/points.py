"""Positions by name: which a file declares, where moves use them with which frames, and which the program computes."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from planner.common.units import Array
from planner.compensation.targets import TargetReading
from planner.programs.languages.statements import PlacedNumber

Frame = Array | str
"""A transform (4, 4) [m], or why it is not known; empty where nobody has said it."""

FramePair = tuple[Frame, Frame]
"""Tool in the flange, and base in the robot's own frame."""

Numbers = dict[str, PlacedNumber] | list[PlacedNumber]


@dataclass(frozen=True)
class Use:
    """A move to a position: tool and base, the index of the target before it, and whether it is a line or a circle.

    ``follows`` is None where the target before is not certain.
    """

    frames: FramePair
    follows: int | None
    linear: bool


@dataclass
class DeclaredPose:
    """A position declared by name.

    Attributes:
        name: with its index, where it is one of a row.
        line: where its numbers stand; 0 in another file.
        value: its numbers, by name or in order; None where they are not in this file or are not plain numbers.
        uses: the moves to it.
        index: its place among the targets, once a move has used it.
    """

    name: str
    line: int
    value: Numbers | None
    typed: bool = True
    uses: list[Use] = field(default_factory=list)
    index: int | None = None


class PointTable:
    """The named positions of a file."""

    def __init__(self, reading: TargetReading, container: str) -> None:
        self.reading, self.container = reading, container
        self._poses: dict[str, list[DeclaredPose]] = {}  # by name without index: those of a row stand together
        self._by_name: dict[str, list[DeclaredPose]] = {}
        self._row_uses = set[tuple[object, ...]]()  # of whole rows, each of which is noted at every point once
        self._computed: dict[str, str] = {}
        self.missing: dict[tuple[str, int], None] = {}  # names that no file declares, and the lines of moves to them

    def declare(self, pose: DeclaredPose) -> None:
        """Note that the file, or its other half, gives ``pose`` a value."""
        self._poses.setdefault(_base(pose.name), []).append(pose)
        self._by_name.setdefault(pose.name, []).append(pose)

    def has(self, name: str) -> bool:
        """Return whether ``name`` is declared."""
        return bool(self._find_by_name(name))

    def is_computed(self, name: str, why: str) -> bool:
        """Return whether ``name`` has no certain value for a reason that begins with ``why``."""
        return self._reason_for(name).startswith(why or "-")

    def compute(self, name: str, why: str) -> None:
        """Note why ``name`` has no certain value; an index that is computed means every one of a row."""
        self._computed.setdefault(name if _fixed_index(name) else _base(name), why)

    def use(self, name: str, line: int, use: Use) -> int | None:
        """Note that a move goes to ``name``, and return its index among the targets, if it is one.

        ``line`` is the move's, 0 in another file.
        """
        found = self._find_by_name(name)
        if not found and line:
            self.missing[name, line] = None
        if len(found) == 1 or self._is_new(name, len(found), use):
            for pose in found:
                if pose.line and pose.index is None:
                    pose.index = self.reading.reserve()
                pose.uses.append(use)
        if line and (why := self._reason_for(name)):
            self.reading.leave(line, f"{_own_name(name)} {why}")
        return found[0].index if len(found) == 1 else None

    def _is_new(self, name: str, count: int, use: Use) -> bool:
        """Tell whether so many points of one name are used in a way that they do not have yet.

        Frames that are not certain count as one: the first reason is the one that is given.
        """
        frames = ("" if isinstance(frame, str) and frame else id(frame) for frame in use.frames)
        way = (_base(name) if not _fixed_index(name) else name, count, *frames, use.follows, use.linear)
        is_new = way not in self._row_uses
        self._row_uses.add(way)
        return is_new

    def finish(self) -> Iterator[DeclaredPose]:
        """Yield the positions to be corrected, and note those that stay as they are."""
        for name, line in self.missing:
            if not self._reason_for(name) and _own_name(name).lower() not in self.reading.declared_together:
                sentence = (
                    f"{_own_name(name)} is declared elsewhere: compensate the {self.container} that declares it too"
                )
                self.reading.leave(line, sentence)
        for poses in self._poses.values():
            for pose in poses:
                computed = bool(self._reason_for(pose.name))
                if not pose.line or not (pose.uses or (pose.typed and not computed)):
                    continue  # of the other half, a frame of its own, or a place where the program keeps something
                if why := self._why_not(pose):
                    self.reading.leave(pose.line, f"{_own_name(pose.name)}{why}")
                else:
                    yield pose

    def _why_not(self, pose: DeclaredPose) -> str:
        if len(self._by_name[pose.name]) > 1:
            return " has more than one value in this file"
        if why := self._reason_for(pose.name):
            return f" {why}"
        if pose.value is None:
            return ": plain numbers are allowed"
        return f" {SENTENCE}" if is_service_name(_own_name(pose.name)) else ""

    def _reason_for(self, name: str) -> str:
        return self._computed.get(name, self._computed.get(_base(name), ""))

    def _find_by_name(self, name: str) -> list[DeclaredPose]:
        if name != _base(name) and _fixed_index(name):
            return self._by_name.get(name, [])
        return self._poses.get(_base(name), [])  # the bare name of a row means every one of it


def _own_name(name: str) -> str:
    """Return a name without the module and the routine that it belongs to."""
    return name.rpartition(".")[2]


def _base(name: str) -> str:
    return name.partition("[")[0].partition("{")[0]


def _fixed_index(name: str) -> bool:
    """Return whether a name has no index, or one that is a number."""
    return re.fullmatch(r"[^\[{]*([\[{]\s*\d+\s*[\]}])?", name) is not None


def common_frames(uses: Sequence[Use], unused: FramePair) -> FramePair:
    """Return tool and base of all moves to a point, or why they differ; ``unused`` if no move drives to it."""
    frames = [use.frames for use in uses] or [unused]
    for pair in frames:
        for one, other in zip(frames[0], pair, strict=True):
            if isinstance(one, str) or isinstance(other, str):
                why = next(f for f in (one, other) if isinstance(f, str))
                return why, why
            if not np.array_equal(one, other):
                why = "its moves have different tools or bases"
                return why, why
    return frames[0]


def common_tool(uses: Sequence[Use], unused: FramePair) -> Frame:
    """Return the tool if all moves to a point agree about it, whatever their bases, else why it is not known."""
    return common_frames([replace(use, frames=(use.frames[0], use.frames[0])) for use in uses], unused)[0]


def trace_sources(made: Sequence[tuple[str, set[str], int]], begun: set[str]) -> dict[str, int]:
    """Return all that the names ``begun`` are made from, however many steps away, and the line of one use each.

    ``made``: of every assignment the name that gets a value, those that it is made from, and the line.
    """
    sources: dict[str, list[tuple[set[str], int]]] = {}
    for left, right, line in made:
        sources.setdefault(left, []).append((right, line))
    found, waiting = dict[str, int](), [name for name in sources if name in begun]
    for name in waiting:  # grows by what is found
        for right, line in sources.get(name, ()):
            new = {source for source in right if source not in found}
            found |= dict.fromkeys(new, line)
            waiting += sorted(new - begun)
    return found


_SERVICE = re.compile(
    r"mas(?:ter)?_?ref|master(?:ing|_?pos)|(?:brake|brems(?:en)?)_?test|justage|service_?pos|sync_?pos"
    r"|calib(?:ration)?_?pos|_calib$|rev_?count|eichen",
    re.IGNORECASE,
)
SENTENCE = "is a mastering or service point, which belongs to the robot's own axes: it is never corrected"


def is_service_name(name: str) -> bool:
    """Return whether a point, routine or file of this name is for mastering or service."""
    return _SERVICE.search(name) is not None
