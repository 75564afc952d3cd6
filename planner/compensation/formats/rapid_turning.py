"""How a RAPID program lets the tool turn on the way of a move, where it then ends otherwise than the target says."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import planner.programs.languages.statements as st
from planner.compensation.formats.rapid_frames import Placed
from planner.programs.languages.rapid import RapidMove


@dataclass(frozen=True)
class _Mode:
    """An instruction that holds until the next one of its kind.

    Attributes:
        word: the instruction.
        free: it, with the switches behind which the orientation of a target is not reached.
        kept: it, with those behind which it is.
        moves: words of the moves that it is for.
        on: what these are.
    """

    word: re.Pattern[str]
    free: re.Pattern[str]
    kept: re.Pattern[str]
    moves: re.Pattern[str]
    on: str


def _mode(word: str, free: str, kept: str, moves: str, on: str) -> _Mode:
    texts = (rf"{word}\b", rf"\b{word}\s*\\\s*(?:{free})\b", rf"{word}\b{kept}", moves)
    patterns = [re.compile(text, re.IGNORECASE) for text in texts]
    return _Mode(patterns[0], patterns[1], patterns[2], patterns[3], on)


_CIRCLE = r"(?:move|trigg|search|arc|cap|disp|paint)c"
_MODES = (
    _mode(
        "SingArea", r"Wrist|LockAxis4", r"\s*\\\s*Off\b", r"(?!(?:move|trigg)(?:j|absj)|spotj)", "a line or a circle"
    ),
    # two axes of the wrist turn, and only the projection of the tool's axis follows the circle
    _mode("CirPathMode", r"Wrist\d\d", r"(?!\s*\\\s*Wrist)", _CIRCLE, "a circle"),
)


def is_linear(move: RapidMove) -> bool:
    """Tell whether a move is a line or a circle."""
    return _MODES[0].moves.match(move.word) is not None


def is_circle(word: str) -> bool:
    """Tell whether a move by this word has a point on its way and another at its end."""
    return re.match(_CIRCLE, word) is not None


class ToolTurning:
    """Which modes may hold at a statement, taken in the order of the file.

    A mode holds beyond the end of a routine and of a cycle: one that stands anywhere holds everywhere, but where the
    statements before say another for certain.
    """

    def __init__(self, placed: Sequence[Placed]) -> None:
        self._free = [next((p for p in placed if mode.free.search(p.statement.text)), None) for mode in _MODES]
        self._kept = [False for _ in _MODES]

    def follow(self, said: st.Statement) -> None:
        """Process the next statement of the file: it may set a mode, or make one uncertain."""
        for k, mode in enumerate(_MODES):
            if mode.word.match(said.text):
                self._kept[k] = mode.kept.match(said.text) is not None
                return
        if isinstance(said, st.Call | st.Flow | st.Routine | st.RoutineEnd) or type(said) is st.Statement:
            self._kept = [False for _ in _MODES]

    def describe_doubt(self, p: Placed, move: RapidMove) -> str:
        """Say why a move may end in another orientation than its target says; nothing where it does not."""
        for mode, free, kept in zip(_MODES, self._free, self._kept, strict=True):
            if free is not None and (p.beside or not kept) and mode.moves.match(move.word):
                found = mode.free.search(free.statement.text)
                assert found is not None
                instruction = re.sub(r"\s*\\\s*", r" \\", found[0])
                return f"{instruction} in {free.where} lets the tool turn otherwise in {mode.on}"
        return ""
