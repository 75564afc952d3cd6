"""Moves of G-code behind calls of programs whose text is not at hand: these may leave G91, an offset or a frame."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from planner.programs.languages.gcode import Block

SAID_AGAIN = {"G90", "G500", "TRANS"}  # words that say again what a call may have changed
NO_OFFSET = {"G53", "G153"}  # that leave offsets and frames out in their own block
_OPENS = re.compile(r"(?P<loop>LOOP|WHILE|FOR|REPEAT)\b|IF\b(?!.*\bGOTO)|CASE\b(?!.*\bOF\b)")
_ELSE = re.compile(r"ELSE\b")
_CLOSES = re.compile(r"(?:END(?:IF|LOOP|WHILE|FOR)|UNTIL)\b")
_LABEL = re.compile(r"[A-Z_]\w*:")
_BACK = re.compile(r"\b(?:GOTO(?!F\b)\w?|REPEATB?)\b")  # to a label before
_CALL_BY_NAME = re.compile(r"(?P<name>[A-Z_]\w*)\s*(?:\(.*\))?(?:\s*P\s*\d+)?")


@dataclass(frozen=True)
class _Move:
    """A move, and the lines in which G90, and that there is no offset, were said last; 0 where they were not."""

    line: int
    absolute: float
    unshifted: float


class CallsElsewhere:
    """The calls of a file, and the moves that may lie behind them, program by program.

    ``jumps``: whether any block of the file may be come to from anywhere.
    """

    def __init__(self, blocks: Sequence[Block], jumps: bool) -> None:
        self._own = {match[1] for b in blocks if (match := re.match(r"PROC\s+(\w+)", b.text))}
        self._jumps, self._back = jumps, any(_BACK.search(b.text) for b in blocks)
        self._elsewhere = False  # whether any call is of a program that is not in the file
        self._doubted: dict[int, int] = {}  # line of the call, by that of the move
        self._begin()

    def end_program(self) -> None:
        """Note the end of a program of the file. What follows a label may have been reached from any line before."""
        if self._first_label:
            self._note_repetition(self._first_label, self._moves)
        self._begin()

    def _begin(self) -> None:
        self._said: dict[str, int] = {}
        self._open: list[tuple[int, bool, dict[str, int]]] = []  # line, whether a loop, and what was said before
        self._calls: list[int] = []
        self._moves: list[_Move] = []
        self._not_repeated: list[_Move] = []  # of no loop that has ended and in which a call stands
        self._first_label = 1 if self._jumps else 0

    def note_modal_words(self, block: Block) -> None:
        """Note words such as G90 that undo what a call may have changed; not in a block that the operator may skip."""
        if not block.optional:
            self._said |= dict.fromkeys(SAID_AGAIN.intersection([*block.codes, block.text]), block.line)

    def call(self, block: Block) -> None:
        """Note that a block calls a program."""
        match = _CALL_BY_NAME.fullmatch(block.text)
        self._elsewhere = self._elsewhere or match is None or match["name"] not in self._own
        self._calls.append(block.line)

    def branch(self, block: Block) -> None:
        """Process a branch, a loop or a label: what is said in one is not certain behind it."""
        if match := _OPENS.match(block.text):
            self._open.append((block.line, match["loop"] is not None, dict(self._said)))
        elif _LABEL.match(block.text):
            self._first_label = self._first_label or (block.line if self._back else 0)
            self._said = {}
        elif self._open and _ELSE.match(block.text):
            self._said = dict(self._open[-1][2])
        elif self._open and _CLOSES.match(block.text):
            first, is_loop, self._said = self._open.pop()
            if is_loop:
                self._note_repetition(first, self._not_repeated)

    def move(self, block: Block) -> None:
        """Process a move with plain angles."""
        off = min(self._said.get("G500", 0), self._said.get("TRANS", 0))
        unshifted = block.line if NO_OFFSET.intersection(block.codes) else off
        move = _Move(block.line, self._said.get("G90", 0), unshifted)
        if self._calls:
            self._check(move, self._calls[-1] + 1, self._calls[-1])
        self._moves.append(move)
        self._not_repeated.append(move)

    def uncertain_moves(self) -> Iterator[tuple[int, str]]:
        """Yield the lines of moves whose targets are not certain, each with the reason, once the file has been read."""
        for line, call in sorted(self._doubted.items()) if self._elsewhere else ():
            yield (
                line,
                f"what line {call} calls is not in the file and may leave G91, an offset or a frame: a G90 behind it "
                "and G53 or G153 in this block make the move certain",
            )

    def _note_repetition(self, first: int, moves: list[_Move]) -> None:
        """Note that the lines from the first one on may be run again, behind the calls among them.

        Their moves are taken from the list: a loop around this one finds no other doubt about them.
        """
        if self._calls and self._calls[-1] >= first:
            while moves and moves[-1].line >= first:
                self._check(moves.pop(), first, self._calls[-1])

    def _check(self, move: _Move, since: int, call: int) -> None:
        if min(move.absolute, move.unshifted) < since:
            self._doubted.setdefault(move.line, call)
