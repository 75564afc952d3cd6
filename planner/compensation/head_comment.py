"""What a partly corrected file says of itself at its head: which lines were corrected, which were left, and why."""

import re
import textwrap
from collections.abc import Iterator, Sequence

from planner.compensation.targets import Note, line_ranges
from planner.programs.dialect import CommentStyle, comment_text
from planner.programs.languages.text import Lines

REASONS = 20  # that are told; the lines are all told
LENGTH = 160  # characters of a reason
_SPELLED = str.maketrans({"µ": "u", "°": " deg", "…": "...", "−": "-"})
_BEHIND = {  # the lines that must stay first
    "krl": re.compile(r"\s*(&|;|(GLOBAL\s+)?DEF(DAT|FCT)?\b)", re.IGNORECASE),
    "rapid": re.compile(r"\s*(!|%%%|VERSION:|LANGUAGE:|MODULE\b)", re.IGNORECASE),
    "gcode": re.compile(r"\s*(%|;\$PATH)", re.IGNORECASE),
    "csv": re.compile(r"(?!)"),
    "pdl2": re.compile(r"(?!)"),
    "urscript": re.compile(r"\s*(#|def\b)"),
    "fanuc": re.compile(r"(?!\s*\d*\s*:)"),
}


def add_head(
    text: str, family: str, style: CommentStyle, robot: str, corrected: Sequence[int], left: Sequence[Note]
) -> str:
    """Return ``text`` with a comment that lists lines as they are counted in the returned text."""
    at, before = _place(text, _BEHIND[family])
    shift, head = -1, [""] * 0
    while shift != len(head):  # the head's own length moves the lines
        shift = len(head)
        head = [
            f"{style.start}{row}{style.end}"
            for said in _sentences(robot, corrected, left, before, shift)
            for row in textwrap.wrap(comment_text(said.translate(_SPELLED), _without_bound(style)), style.max_length)
        ]
    end = "\r\n" if "\r\n" in text else "\n"
    gap = end if at and not text[:at].endswith(("\n", "\r")) else ""
    return text[:at] + gap + "".join(row + end for row in head) + text[at:]


def _sentences(robot: str, corrected: Sequence[int], left: Sequence[Note], before: int, shift: int) -> Iterator[str]:
    def lines(numbers: Sequence[int]) -> str:
        return line_ranges(n + shift if n > before else n for n in numbers)

    yield f"Compensated in part for {robot}. Lines are counted in this file."
    yield f"Corrected lines: {lines(corrected) or 'none'}."
    reasons: dict[str, list[int]] = {}
    for line, why in left:
        here = re.sub(r"\bline (\d++)(?! of (?:the other|module))", lambda m: f"line {lines([int(m[1])])}", why)
        reasons.setdefault(textwrap.shorten(here, LENGTH, placeholder=" ..."), []).append(line)
    for count, (why, where) in enumerate(reasons.items(), start=1):
        if count > REASONS:
            rest = [n for group in list(reasons.values())[REASONS:] for n in group]
            yield f"Left as they were for other reasons: {lines(rest)}."
            break
        yield f"Left as written, lines {lines(where)}: {why}."


def _place(text: str, behind: re.Pattern[str]) -> tuple[int, int]:
    """Return where the head goes, and how many lines stand before it."""
    place = (1, 0) if text.startswith("\ufeff") else (0, 0)
    for line, start, said in Lines.of(text):
        if not behind.match(said.lstrip("\ufeff")):
            if said.strip():
                break
            continue
        end = start + len(said)
        end += len(re.match(r"\r\n|\n|\r|", text[end:])[0])  # type: ignore[index]
        place = end, line
        if re.match(r"\s*(MODULE|(GLOBAL\s+)?DEF)", said, re.IGNORECASE):
            break
    return place


def _without_bound(style: CommentStyle) -> CommentStyle:
    return style.model_copy(update={"max_length": 100_000})
