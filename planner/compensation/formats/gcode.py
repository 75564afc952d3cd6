"""G-code whose axis words are the robot's joints (``A1=10.5`` or ``X10.5``), one block a line.

The words are modal: a block that leaves an axis out keeps its angle. The corrected angles of all axes differ from
block to block, so every block is written with all of them.
"""

import re

import numpy as np

from planner.common.units import DEG, read_only
from planner.compensation.targets import DEG_DECIMALS, Target, TargetReading
from planner.programs.dialect import Dialect
from planner.programs.languages.gcode import Block, parse
from planner.programs.languages.statements import PlacedNumber
from planner.programs.languages.text import Slot

_MOTION_WORDS = {"G0", "G1", "G2", "G3", "G5", "G33", "G100", "G101", "G102", "G103"}
_BESIDE = {
    "G4",
    "G9",
    "G53",
    "G153",
    "G60",
    "G61",
    "G61.1",
    "G64",
    "G90",
    "G93",
    "G94",
    "G95",
    "G641",
    "G642",
    "G126",
    "G161",
}
_CARTESIAN = set("XYZABCUVWIJKE")  # and E, with which an exponent would begin
_REFUSED = {"G20": "inches", "G70": "inches", "G700": "inches", "G91": "relative angles", "G162": "relative angles"}
_FLOW = re.compile(
    r"\b(IF|ELSE|ENDIF|WHILE|ENDWHILE|FOR|ENDFOR|LOOP|ENDLOOP|REPEAT|UNTIL|GOTO[BFC]?|CASE)\b|^O\w+|^\s*L\d+"
)


def read(text: str, dialect: Dialect, reading: TargetReading) -> None:
    """Note the target of every block, and refuse blocks that move in a way that is not known."""
    targets = _GcodeTargets(dialect, reading)
    for block in parse(text, dialect):
        targets.take(block)


class _GcodeTargets:
    """The modal state, as far as it decides what an axis word means."""

    def __init__(self, dialect: Dialect, reading: TargetReading) -> None:
        self.reading = reading
        self.equals = dialect.axes[0].endswith("=")
        self.axes = [axis.rstrip("=").upper() for axis in dialect.axes]
        self.joints = self.axes[: len(reading.axes)]
        self.motion = dialect.reading.motion
        self.work_offset = "G53" if "X" in self.axes else ""
        self.mode = ""
        self.last: list[float | None] = [None] * len(self.joints)

    def take(self, block: Block) -> None:
        """Take in one block."""
        if block.words is None:
            self._statement(block)
            return
        for code in block.codes:
            if code in _REFUSED:
                self._refuse_unit(block, code)
            self.mode = code if code in _MOTION_WORDS else self.mode
        foreign = [name for name, _ in block.words if name in _CARTESIAN and name not in self.axes]
        if foreign:
            sentence = f"the word {foreign[0]} found; the robot's axes are {' '.join(self.joints)} in this dialect"
            self.reading.refuse(block.line, sentence)
        elif words := [word for word in block.words if word[0] in self.axes]:
            self._move(block, words)

    def _refuse_unit(self, block: Block, code: str) -> None:
        sentence = f"{code} found ({_REFUSED[code]}); absolute angles in degrees are allowed"
        self.reading.refuse(block.line, sentence)

    def _statement(self, block: Block) -> None:
        """Pass a line that is no row of words by, unless it moves an axis or makes the order of blocks uncertain."""
        names = "|".join(self.joints)
        assigned = rf"(?<![\w$\[<])({names})\s*=(?!=)" if self.equals else rf"(?<![\w$<])({names})\s*[\[#]"
        bare = re.sub(r"\[[^\[\]]*\]|\([^()]*\)", " ", block.text) if self.equals else block.text
        if match := re.search(assigned, bare):
            sentence = f"'{block.text}' computes axis {match[1]}; axis words with plain numbers are allowed"
            self.reading.refuse(block.line, sentence)
        elif match := re.search(rf"(?<![\w.])({'|'.join(_REFUSED)})(?![\w.])", bare):
            self._refuse_unit(block, match[1])
        if _FLOW.search(block.text):
            self.last = [None] * len(self.joints)

    def _move(self, block: Block, words: list[tuple[str, PlacedNumber]]) -> None:
        wrong = self._why_not(block, [name for name, _ in words])
        if wrong:
            self.reading.refuse(block.line, wrong)
            return
        if self.work_offset and self.work_offset not in block.codes:
            self.reading.notes.append((block.line, "no G53: the work offset is taken as zero"))
        given = dict(words)
        after = words[-1][1].start + len(words[-1][1].text)
        slots: list[Slot] = []
        for k, name in enumerate(self.joints):
            if name in given:
                self.last[k] = given[name].value * DEG
                slots.append(given[name].slot(DEG, DEG_DECIMALS))
            else:
                slots.append(Slot(after, after, DEG, DEG_DECIMALS, prefix=f" {name}{'=' if self.equals else ''}"))
        unknown = [name for name, angle in zip(self.joints, self.last, strict=True) if angle is None]
        if unknown:
            sentence = (
                f"the angle of {', '.join(unknown)} is not known here; the first move, and the first after a jump, "
                "must name all axes"
            )
            self.reading.refuse(block.line, sentence)
            return
        self.reading.add(Target(block.line, tuple(slots), q=read_only(np.array(self.last, dtype=float))))

    def _why_not(self, block: Block, names: list[str]) -> str | None:
        """Say why a block with axis words cannot be compensated."""
        allowed = rf"{self.motion}|G0"
        strange = [code for code in block.codes if code not in _BESIDE and not re.fullmatch(allowed, code)]
        if not re.fullmatch(allowed, self.mode) or strange:
            return f"'{block.text}' is no joint move; {self.motion} and G0 are allowed"
        for name in names:
            if name not in self.joints:
                return f"axis {name} is not one of the robot's; {' '.join(self.joints)} are allowed"
            if names.count(name) > 1:
                return f"axis {name} stands twice"
        return None
