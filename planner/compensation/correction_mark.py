"""The mark of a corrected file, by which it is never corrected a second time, and that of a measuring program.

The mark is a comment at the head of every corrected file: ``edbb-compensated``, the first digits of the hash of the
model, whether anybody measured that robot, and a date. The hash is of what the model's files say, not of their bytes,
which editors and version control change (line ends, comments): the same model always gives the same mark. The mark is
looked for in the whole file and whatever the case of its letters: editors and controllers move, indent and capitalise
comments.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import date

from planner.common.content_hashes import HandEdit
from planner.common.errors import InputError
from planner.programs.languages.statements import Lines

WORD = "edbb-compensated"
HASH_DIGITS = 12  # of the hash in the mark: a remark of FANUC has 31 characters
_MARK = re.compile(rf"{WORD}\b(?:[^\w\n\r]{{1,8}}(?P<hash>[0-9a-f]{{1,64}})\b)?", re.IGNORECASE)
_OLD_MARK = re.compile(
    r"\bCompensated in part for\b", re.IGNORECASE
)  # of files corrected in part before marks named a model
_PLAN = re.compile(r'\bplan_id"?:\s*"?(?P<plan>[0-9a-f]{12})\b', re.IGNORECASE)


@dataclass(frozen=True)
class CorrectionMark:
    """Which model corrects a file.

    Attributes:
        model_hash: SHA-256 of what the model's ``robot.toml`` (and URDF) says, hexadecimal.
        simulated: whether the model comes of a simulated run; ``None`` where nothing beside it tells.
        day: of the model, or the one that the person has named; ``None`` where there is none.
        zeros: joints, from 1, whose zeros were set in the controller, so that they are not corrected for.
        hand_edits: what a person changed in the model since edbb wrote it.
    """

    model_hash: str
    simulated: bool | None = None
    day: date | None = None
    zeros: tuple[int, ...] = ()
    hand_edits: tuple[HandEdit, ...] = ()

    def sentence(self, robot: str) -> str:
        """Return the sentence in the head of the corrected file; its first two words are the mark."""
        origin = {True: "SIMULATED", False: "measured", None: "origin of the model unknown"}[self.simulated]
        day = "" if self.day is None else f", {self.day.isoformat()}"
        zeros = f" whose zeros {', '.join(map(str, self.zeros))} are set in the controller" if self.zeros else ""
        said = f"Corrected for {robot}{zeros}: never correct it again."
        return f"{WORD} {self.model_hash[:HASH_DIGITS]}, {origin}{day}. {said}"

    def sentences(self, robot: str) -> list[str]:
        """Return all sentences in the head of the corrected file: the mark, and what was changed by hand."""
        return [self.sentence(robot), *(f"{edit.remark}." for edit in self.hand_edits)]


def refuse_second_correction(name: str, text: str, mark: CorrectionMark, again: bool) -> None:
    """Refuse a file that was corrected before: a second correction would add to the first.

    Args:
        name: of the file.
        text: its content.
        mark: of the model that is to correct it now.
        again: the person says that the correction by another model is to be added.

    Raises:
        InputError: the file bears the mark of this model, or one that names no model; or that of another model, and
            ``again`` is not said.
    """
    for line, found in _find_marks(text):
        if not found:
            raise InputError(
                f"{name}:{line}: the file was corrected before, by a model that the mark there does not name; correct "
                "the original program instead"
            )
        if mark.model_hash.startswith(found[:HASH_DIGITS]):
            raise InputError(
                f"{name}:{line}: the file was corrected before, by this same model ({found}): a second correction "
                "would be added to the first; correct the original program instead"
            )
        if not again:
            raise InputError(
                f"{name}:{line}: the file was corrected before, by another model, whose hash begins with "
                f"{found}; the corrections would add up. Correct the original program instead; --again "
                "only where this model was identified with programs that the other one corrects"
            )


def _find_marks(text: str) -> Iterator[tuple[int, str]]:
    """Yield line and hash, small letters, of every mark; the hash is empty where the mark holds none."""
    is_marked = _MARK.search(text) is not None
    for line, _, said in Lines.of(text):
        yield from ((line, (match["hash"] or "").lower()) for match in _MARK.finditer(said))
        if not is_marked and _OLD_MARK.search(said):
            yield line, ""


def check_no_measuring_program(name: str, text: str) -> None:
    """Refuse what drives or lists the poses of a plan.

    Raises:
        InputError: the file names its plan.
    """
    for line, _, said in Lines.of(text):
        if match := _PLAN.search(said):
            raise InputError(
                f"{name}:{line}: the file belongs to the measuring plan {match['plan'].lower()}: its poses are nominal "
                "on purpose, and its path (range of the bar, distances) is proven as it stands, not as corrected. "
                "Compensation is for programs that work. --measuring corrects it all the same"
            )
