"""Which jobs a list holds, and where in it a page ends."""

import re
from dataclasses import dataclass
from typing import Literal

from planner.common.errors import InputError

PLACE = r"([0-9]{1,12}\.[0-9]{1,9})-([0-9a-f]{24})"  # in a list, as text
State = Literal["queued", "running", "done", "failed", "cancelled"]


@dataclass(frozen=True)
class JobPlace:
    """A place in the list of jobs, which is ordered by the time of submission, the latest first.

    Attributes:
        created: when the last job before it was submitted [s since 1970].
        id: of that job.
    """

    created: float
    id: str

    @classmethod
    def parse(cls, text: str) -> "JobPlace":
        """Read a place as ``str`` writes it.

        Raises:
            InputError: it is none.
        """
        found = re.fullmatch(PLACE, text)
        if found is None:
            raise InputError(f"after: '{text}' is no place in a list; take it from the Link header of the page before")
        return cls(float(found[1]), found[2])

    def __str__(self) -> str:
        return f"{self.created!r}-{self.id}"


SERIALS = """
SELECT outputs.job AS job, serial FROM recorded JOIN outputs ON outputs.sha256 = document_sha256 WHERE withdrawn = 0
UNION SELECT inputs.job, serial FROM recorded JOIN inputs ON inputs.sha256 = document_sha256 WHERE withdrawn = 0
UNION SELECT plan, serial FROM cell_sessions WHERE serial != ''
"""
"""Jobs with the serial numbers of their robots: whose results a record holds, that start from one, whose plan it is."""
OF_SERIAL = f"SELECT job FROM ({SERIALS}) WHERE instr(lower(serial), ?) > 0"
OF_TEXT = f"(instr(lower(title || ' ' || note), ?) > 0 OR id IN ({OF_SERIAL}))"


@dataclass(frozen=True)
class JobFilter:
    """What is wanted of jobs; nothing where all are.

    Attributes:
        kind: of the job; without one the short tasks of pages are left out, unless ``tasks`` says otherwise.
        state: how far it is.
        robot: model of the robot.
        person: who asked for it.
        text: stands in title, note, or the serial number of its robot.
        since, until: when it was submitted [s since 1970].
        tasks: whether the tasks of pages (views, checks of cells) are in the list of all kinds.
        archived: whether those are wanted that were put aside, or the others; both where it is ``None``.
    """

    kind: str | None = None
    state: State | None = None
    robot: str | None = None
    text: str = ""
    since: float | None = None
    until: float | None = None
    tasks: bool = False
    archived: bool | None = None
    person: str | None = None

    def condition(self) -> tuple[str, tuple[object, ...]]:
        """Return the condition of a query, and the values of its places."""
        parts: list[tuple[str, object]] = [
            ("kind = ?", self.kind), ("state = ?", self.state), ("robot = ?", self.robot), ("created >= ?", self.since),
            ("created < ?", self.until), (OF_TEXT, self.text.lower() or None),
            ("task = ?", None if self.kind or self.tasks else 0), ("archived = ?", self.archived),
            ("id IN (SELECT job FROM askers WHERE person = ?)", self.person),
        ]  # fmt: skip
        given = [(text, value) for text, value in parts if value is not None]
        values = (v for text, value in given for v in [value] * text.count("?"))
        return " AND ".join(["1", *(text for text, _ in given)]), tuple(values)
