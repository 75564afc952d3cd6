"""What was measured, kept row by row: a journal beside the run, so that a session can stop anywhere and go on later."""

import os
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

import numpy as np
from pydantic import NonNegativeInt

from planner.centring.path import PlannedPath
from planner.common.errors import InputError
from planner.common.files import read_bytes, write_text
from planner.common.schema import StrictModel
from planner.common.units import from_deg, from_mm, read_only
from planner.runs.run import Readings, Run, Samples, index_names
from planner.runs.writer import run_text

SCHEMA = "edbb-centring-journal/1"


class JournalHead(StrictModel):
    """First line: which plan is measured, and when the first session began (seconds since 1970)."""

    schema_name: str
    plan_id: str
    robot: str
    began_s: float


class JournalRow(StrictModel):
    """One centred pose, in the units of a run; the offset is the point's from the ball's centre in the plate's axes."""

    pose: NonNegativeInt
    ball: str
    session: int
    t_s: float
    q_deg: tuple[float, ...]
    cmd_deg: tuple[float, ...]
    offset_mm: tuple[float, float, float]
    reading_mm: tuple[float, float, float]
    found_mm: tuple[float, float, float]
    moves: int


@dataclass
class Journal:
    """The rows so far; ``output`` is the run, its journal stands beside it; ``remarks`` a person's above the run."""

    output: Path
    head: JournalHead
    rows: list[JournalRow]
    remarks: str = ""

    @property
    def path(self) -> Path:
        """Path of the journal's file."""
        return journal_path(self.output)

    @property
    def session(self) -> int:
        """Number of a session that begins now."""
        return 1 + max((r.session for r in self.rows), default=-1)

    @property
    def measured_ids(self) -> set[int]:
        """Ids of the poses that are measured."""
        return {r.pose for r in self.rows}

    def add(self, row: JournalRow) -> None:
        """Keep a row: it is on the disk when this returns, in the journal first and then in the run.

        Raises:
            InputError: the files cannot be written.
        """
        try:
            with self.path.open("ab") as file:
                lines = [row] if self.rows else [self.head, row]
                file.write(b"".join(line.model_dump_json().encode() + b"\n" for line in lines))
                file.flush()
                os.fsync(file.fileno())
        except OSError as err:
            raise InputError(f"{self.path}: cannot be written ({err.strerror or err})") from err
        self.rows.append(row)
        self.write()

    def write(self) -> None:
        """Write the run as it is now, whole."""
        write_text(self.output, self.remarks + run_text(run_of(self.head, self.rows, self.output.stem)))


def open_journal(output: Path, way: PlannedPath, now_s: float) -> Journal:
    """Open the journal of ``output``, or begin it.

    Raises:
        InputError: not a .csv; it is there without its journal; it belongs to another plan, or cannot be read.
    """
    if output.suffix.lower() != ".csv":
        raise InputError(f"{output}: a centring session writes a .csv")
    path = journal_path(output)
    if path.exists():
        return _resume_journal(output, path, way)
    if output.exists():
        raise InputError(f"{output} is there, but not its journal {path.name}; give another file with -o")
    head = JournalHead(schema_name=SCHEMA, plan_id=way.plan_id, robot=way.robot, began_s=round(now_s, 3))
    return Journal(output, head, [])


def journal_path(output: Path) -> Path:
    """Return where the journal of a run stands."""
    return output.with_name(output.name + ".journal")


def run_of(head: JournalHead, rows: list[JournalRow], name: str) -> Run:
    """Return the rows as a run of poses at rest."""
    ball, balls = index_names([r.ball for r in rows])
    q = read_only(from_deg([r.q_deg for r in rows]))
    session = np.array([r.session for r in rows])
    samples = Samples(
        q=q,
        place=np.zeros(len(rows), dtype=np.int64),
        t=read_only([r.t_s for r in rows]),
        q_read=q,
        q_cmd=read_only(from_deg([r.cmd_deg for r in rows])),
        session=session,
        pose=np.array([r.pose for r in rows]),
    )
    readings = Readings(ball=ball, offset=read_only(from_mm([r.offset_mm for r in rows])))
    return Run(name, samples, readings, ("",), balls, plan_id=head.plan_id, robot=head.robot)


def _resume_journal(output: Path, path: Path, way: PlannedPath) -> Journal:
    """Read a journal; a last line that was cut off by a power failure is taken out of it."""
    lines = read_bytes(path).split(b"\n")
    whole, torn = lines[:-1], lines[-1]
    try:
        head = JournalHead.model_validate_json(whole[0] if whole else b"")
        rows = [JournalRow.model_validate_json(line) for line in whole[1:]]
    except ValueError as err:
        raise InputError(f"{path}: is no journal of a centring session; give another file with -o") from err
    if head.plan_id != way.plan_id:
        raise InputError(
            f"{path}: belongs to plan {head.plan_id}, but this is plan {way.plan_id}; give another file with -o"
        )
    _check_rows(path, rows, way)
    journal = Journal(output, head, rows, _remarks(output))
    if torn:
        write_text(path, b"".join(line + b"\n" for line in whole).decode(), own=True)
    if rows:
        journal.write()
    return journal


OWN_NOTES = ("measure", "clocks", "plan_id", "robot")  # that a run is written with anyway


def _remarks(output: Path) -> str:
    """Return the comments that a person has put above the run, such as what the indicators showed on the master."""
    if not output.is_file():
        return ""
    lines = output.read_text(encoding="utf-8", errors="replace").splitlines()
    own = tuple(f"# {key}:" for key in OWN_NOTES)
    head = takewhile(lambda line: line.startswith("#"), lines)
    return "".join(f"{line}\n" for line in head if not line.startswith(own))


def _check_rows(path: Path, rows: list[JournalRow], way: PlannedPath) -> None:
    """Refuse rows that no session of this plan can have written.

    Raises:
        InputError: naming the line.
    """
    balls, seen, joints = {v.id: v.ball for v in way.visits}, set[int](), way.q.shape[1]
    for line, row in enumerate(rows, start=2):
        if {len(row.q_deg), len(row.cmd_deg)} != {joints}:
            raise InputError(f"{path}, line {line}: {joints} joint angles are needed, read and commanded")
        if balls.get(row.pose) != row.ball:
            raise InputError(f"{path}, line {line}: pose {row.pose} on ball {row.ball} is none of the plan's")
        if row.pose in seen:
            raise InputError(f"{path}, line {line}: pose {row.pose} is measured twice")
        seen.add(row.pose)
