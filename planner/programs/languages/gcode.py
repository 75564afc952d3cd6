"""G-code: one block a line, axis words as ``X10.5`` or ``A1=10.5``."""

import re

from planner.common.errors import InputError
from planner.programs.dialect import Dialect
from planner.programs.languages.execution import ExecutionTrace, parse_fixed


def read(dialect: Dialect, texts: tuple[str, ...], trace: ExecutionTrace) -> None:
    """Note the moves of the one file; its words come from ``[reading]`` and the axis names."""
    _GcodeMachine(dialect, trace).run(texts[0])


class _GcodeMachine:
    """The modal state of a G-code interpreter, as far as joint paths need it."""

    def __init__(self, dialect: Dialect, trace: ExecutionTrace) -> None:
        self.trace = trace
        self.words = dialect.reading
        self.axes = [axis.rstrip("=") for axis in dialect.axes]
        self.blend: float | None = 0.0  # rounding as the machine likes, until a block says otherwise
        self.feed: float | None = None
        self.in_pulse = False
        self.ended = False

    def run(self, text: str) -> None:
        """Execute a whole program; raises InputError at a block that is not understood, or where the end is missing."""
        for count, line in enumerate(text.splitlines(), start=1):
            block = re.sub(r"\([^)]*\)|;.*", "", line).strip()
            block = re.sub(r"^N\d+\s*", "", block)
            if block and not block.startswith("%"):
                self._block(block, f"line {count}")
        if not self.ended:
            raise InputError("the program has no end (M2 or M30)")

    def _block(self, block: str, where: str) -> None:
        if self.ended:
            raise InputError(f"{where}: '{block}' stands behind the end of the program")
        words = self.words
        if re.match(words.sync, block):
            self.trace.syncs += 1
            self.in_pulse = bool(words.pulse_end)
        elif words.pulse_end and re.match(words.pulse_end, block):
            self.in_pulse = False
        elif dwell := re.fullmatch(words.dwell, block):
            if not self.in_pulse:
                self.trace.dwell(parse_fixed(dwell["seconds"], where))
        elif re.search(rf"(^|\s){words.motion}(\s|$)", block):
            self._move(block, where)
        elif words.exact and re.fullmatch(words.exact, block):
            self.blend = None
        elif words.blended and (rounding := re.fullmatch(words.blended, block)):
            self.blend = parse_fixed(rounding["value"], where)
        elif re.fullmatch("M0?2|M30", block):
            self.ended = True

    def _move(self, block: str, where: str) -> None:
        self.in_pulse = False  # a pulse given in passing ends by itself
        here = bool(self.words.exact and re.search(rf"(^|\s)({self.words.exact})(\s|$)", block))
        found: dict[str, float] = {}
        for word in block.split():
            if re.fullmatch(r"G[\d.]+", word):
                continue
            if word.startswith("F"):
                self.feed = parse_fixed(word[1:], where)
                continue
            match = re.fullmatch(r"([A-Z]\d?)=(.+)|([A-Z])(.+)", word)
            axis = "" if match is None else match[1] or match[3]
            if match is None or axis not in self.axes or axis in found:
                raise InputError(f"{where}: the word '{word}' is unknown or stands twice")
            found[axis] = parse_fixed(match[2] or match[4], where)
        if list(found) != self.axes[: len(found)]:
            raise InputError(f"{where}: axes {list(found)} are not the first of {self.axes}")
        if self.feed is None:
            raise InputError(f"{where}: the first move has no feed")
        self.trace.move(list(found.values()), None if here else self.blend, self.feed)
