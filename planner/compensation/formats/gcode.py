"""G-code whose axis words are the robot's joints (``A1=10.5`` or ``X10.5``), one block a line.

The words are modal: a block that leaves an axis out keeps its angle. The corrected angles of all axes differ from
block to block, so every block is written with all of them.
"""

import re

import numpy as np

from planner.common.units import DEG, read_only
from planner.compensation.dialect_words import DialectWords
from planner.compensation.targets import Target, TargetReading
from planner.programs.languages.text import NUMBER, Lines, Slot, mask_comments

DECIMALS = 5
Word = tuple[str, str, int, int]  # name, number, its start and end in the block
_MOTION_WORDS = {"G0", "G1", "G2", "G3", "G5", "G33", "G100", "G101", "G102", "G103"}
_BESIDE = {"G4", "G9", "G53", "G60", "G61", "G61.1", "G64", "G90", "G93", "G94", "G95", "G641", "G642", "G126", "G161"}
_CARTESIAN = set("XYZABCUVWIJK")
_REFUSED = {"G20": "inches", "G70": "inches", "G700": "inches", "G91": "relative angles", "G162": "relative angles"}
_FLOW = re.compile(
    r"\b(IF|ELSE|ENDIF|WHILE|ENDWHILE|FOR|ENDFOR|LOOP|ENDLOOP|REPEAT|UNTIL|GOTO[BFC]?|CASE)\b|^O\w+|^\s*L\d+"
)


def read(text: str, words: DialectWords, reading: TargetReading) -> None:
    """Note the joint targets of one program."""
    _GcodeTargets(words, reading).run(text)


class _GcodeTargets:
    """The modal state, as far as it decides what an axis word means."""

    def __init__(self, words: DialectWords, reading: TargetReading) -> None:
        self.reading = reading
        self.equals = words.axes[0].endswith("=")
        self.axes = [axis.rstrip("=").upper() for axis in words.axes]
        self.joints = [axis.rstrip("=").upper() for axis in reading.axes]
        self.start, self.end = words.comment.start.strip(), words.comment.end
        self.motion = words.reading.motion
        self.work_offset = "G53" if "X" in self.axes else ""
        self.word = re.compile(rf"([A-Z]+\d*=|[A-Z])\s*({NUMBER})")
        self.mode = ""
        self.last: list[float | None] = [None] * len(self.joints)

    def run(self, text: str) -> None:
        """Note the target of every block, and refuse blocks that move in a way that is not known."""
        comment = r"\([^)\r\n]*\)|;[^\r\n]*" if self.end else rf"{re.escape(self.start)}[^\r\n]*"
        for number, place, line in Lines.of(mask_comments(text, comment)):
            block = line.upper()
            head = re.match(r"\s*(?:/\d*\s*)?(?:N\d+\s*)?", block)
            offset = 0 if head is None else head.end()
            if block.strip() and not block.lstrip().startswith("%"):
                self._block(number, place + offset, block[offset:])

    def _block(self, number: int, place: int, block: str) -> None:
        found = self._words(block)
        if found is None:
            self._statement(number, block)
            return
        codes = ["G" + str(float(v)).removesuffix(".0") for letter, v, _, _ in found if letter == "G"]
        for code in codes:
            if code in _REFUSED:
                self.reading.refusals.add(
                    number, f"{code} found ({_REFUSED[code]}); absolute angles in degrees are allowed"
                )
            self.mode = code if code in _MOTION_WORDS else self.mode
        axis_words = [w for w in found if w[0] in self.axes]
        foreign = [w[0] for w in found if w[0] in _CARTESIAN and w[0] not in self.axes]
        if foreign:
            refusal = f"the word {foreign[0]} found; the robot's axes are {' '.join(self.joints)} in this dialect"
            self.reading.refusals.add(number, refusal)
        elif axis_words:
            self._move(number, place, block, axis_words, codes)

    def _words(self, block: str) -> list[Word] | None:
        """Return (name, number, start, end of the number), or None where the block is no plain row of words."""
        found, at = [], 0
        for match in self.word.finditer(block):
            if block[at : match.start()].strip():
                return None
            found.append((match[1].rstrip("="), match[2], match.start(2), match.end(2)))
            at = match.end()
        return found if not block[at:].strip() else None

    def _statement(self, number: int, block: str) -> None:
        """Pass a line that is no row of words by, unless it moves an axis or makes the order of blocks uncertain."""
        names = "|".join(self.joints)
        assigned = rf"(?<![\w$\[<])({names})\s*=(?!=)" if self.equals else rf"(?<![\w$<])({names})\s*[\[#]"
        bare = re.sub(r"\[[^\]]*\]|\([^)]*\)", lambda m: " " * len(m[0]), block) if self.equals else block
        if match := re.search(assigned, bare):
            self.reading.refusals.add(
                number, f"'{block.strip()}' computes axis {match[1]}; axis words with plain numbers are allowed"
            )
        elif match := re.search(rf"(?<![\w.])({'|'.join(_REFUSED)})(?![\w.])", bare):
            self.reading.refusals.add(
                number, f"{match[1]} found ({_REFUSED[match[1]]}); absolute angles in degrees are allowed"
            )
        if _FLOW.search(block):
            self.last = [None] * len(self.joints)

    def _move(self, number: int, place: int, block: str, words: list[Word], codes: list[str]) -> None:
        wrong = self._why_not(block, [w[0] for w in words], codes)
        if wrong:
            self.reading.refusals.add(number, wrong)
            return
        if self.work_offset and self.work_offset not in codes:
            self.reading.notes.append((number, "no G53: the work offset is taken as zero"))
        given = {name: (value, start, end) for name, value, start, end in words}
        after = place + words[-1][3]
        slots: list[Slot] = []
        for k, name in enumerate(self.joints):
            if name in given:
                value, start, end = given[name]
                self.last[k] = float(value) * DEG
                slots.append(Slot(place + start, place + end, DEG, DECIMALS))
            else:
                slots.append(Slot(after, after, DEG, DECIMALS, prefix=f" {name}{'=' if self.equals else ''}"))
        unknown = [n for n, v in zip(self.joints, self.last, strict=True) if v is None]
        if unknown:
            self.reading.refusals.add(
                number,
                f"the angle of {', '.join(unknown)} is not known here; the first move, and the first after a jump, "
                "must name all axes",
            )
            return
        self.reading.targets.append(Target(number, tuple(slots), q=read_only(np.array(self.last, dtype=float))))

    def _why_not(self, block: str, names: list[str], codes: list[str]) -> str | None:
        """Say why a block with axis words cannot be compensated."""
        allowed = rf"{self.motion}|G0"
        strange = [c for c in codes if c not in _BESIDE and not re.fullmatch(allowed, c)]
        if not re.fullmatch(allowed, self.mode) or strange:
            return f"'{block.strip()}' is no joint move; {self.motion} and G0 are allowed"
        for name in names:
            if name not in self.joints:
                return f"axis {name} is not one of the robot's; {' '.join(self.joints)} are allowed"
            if names.count(name) > 1:
                return f"axis {name} stands twice"
        return None
