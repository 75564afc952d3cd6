"""What was measured, kept row by row: a journal beside the run, so that a session can stop anywhere and go on later.

The way through a plan's poses as it was planned, and how to come from any of its points to any other.
"""

import os
from dataclasses import dataclass
from itertools import pairwise, takewhile
from pathlib import Path

import numpy as np
from pydantic import NonNegativeInt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from planner.common.errors import InputError
from planner.common.files import read_bytes, write_text
from planner.common.schema import StrictModel
from planner.common.units import Array, from_deg, from_mm, read_only, to_deg
from planner.runs.run import Readings, Run, Samples, index_names
from planner.runs.writer import run_text
from planner.session.document import PlanDocument, read_plan


@dataclass(frozen=True)
class BallVisit:
    """A pose to be centred: its id, the ball's name, and where on the way it stands."""

    id: int
    ball: str
    at: int


@dataclass(frozen=True)
class PlannedPath:
    """The planned way.

    Attributes:
        plan_id, robot: of the plan.
        q: points in the order driven, controller angles (m, N) [rad].
        visits: poses to be centred, in that order.
        joined: pairs of points between which the plan has proven a straight leg beside the way.
    """

    plan_id: str
    robot: str
    q: Array
    visits: tuple[BallVisit, ...]
    joined: tuple[tuple[int, int], ...] = ()

    def points_to_drive(self, start: int, end: int) -> list[int]:
        """Return the points to drive from ``start`` to ``end``, both among them.

        It is the planned way; past poses that are not centred, the quickest one over proven legs.
        """
        low, high = sorted((start, end))
        passes = any(low < v.at < high for v in self.visits)
        return self._quickest_way(start, end) if passes else self.points_between(start, end)

    def _quickest_way(self, start: int, end: int) -> list[int]:
        """Return the points of the quickest way over proven legs: of the planned way, and those beside it.

        A leg counts by how far its furthest axis turns. Points of the way that are one pose count as one; a ball on the
        way is touched only where no way leads past it.
        """
        _, first, again = np.unique(np.round(to_deg(self.q), 6), axis=0, return_index=True, return_inverse=True)
        same = first[again.ravel()]
        last = len(self.q) - 1
        legs = np.array([*((k, k + 1) for k in range(last)), *self.joined], dtype=int)
        a, b = np.unique(np.sort(same[legs], axis=1), axis=0).T
        cost = np.abs(self.q[a] - self.q[b]).max(axis=1)
        touching = same[[v.at for v in self.visits if v.at not in (start, end)]]
        # 1e3: [rad] more than any way is long; 1e-3: of two as long the one with fewer points
        cost = cost + 1e-3 + 1e3 * (np.isin(a, touching) | np.isin(b, touching))
        graph = csr_array((cost, (a, b)), shape=(last + 1, last + 1))
        _, before = dijkstra(graph, directed=False, indices=int(same[start]), return_predecessors=True)
        way = [int(same[end])]
        while way[-1] != same[start]:
            way.append(int(before[way[-1]]))
        return [start, *way[::-1][1:-1], end]

    def points_between(self, start: int, end: int) -> list[int]:
        """Return the points to drive from ``start`` to ``end``, both among them; a touch on the way is left out.

        The way is as free backward as forward. Where a ball is approached and left through the same point, it is not
        approached for nothing.
        """
        step = 1 if end >= start else -1
        touching = {v.at for v in self.visits}
        points: list[int] = []
        for k in range(start, end + step, step):
            inner = k not in (start, end) and k in touching
            if not inner or not self._are_same_point(k - 1, k + 1):
                points.append(k)
        return points

    def approach_point(self, visit: BallVisit, start: int) -> int:
        """Return the point off the ball from which a visit is approached, coming from ``start`` (maybe the ball)."""
        behind = visit.at + 1
        ahead = visit.at - 1 if visit.at > 0 else behind
        return behind if start > visit.at and behind < len(self.q) else ahead

    def nearest_point(self, q: Array) -> tuple[int, float]:
        """Return the point that is nearest to q (N,) [rad] and how far its furthest axis is [rad]."""
        off = np.abs(self.q - q).max(axis=1)
        return int(off.argmin()), float(off.min())

    def _are_same_point(self, a: int, b: int) -> bool:
        return bool(np.abs(to_deg(self.q[a] - self.q[b])).max() < 1e-6)  # [deg] apart: one point of the way


def read_planned_path(path: Path) -> PlannedPath:
    """Read the planned path, with its poses and moves, from the plan at ``path``.

    Raises:
        InputError: no plan, no balls, poses of unlike length, or balls that follow each other with no path between.
    """
    plan = read_plan(path, "robot", "poses")
    points, joined = _drive_points(plan) if plan.drives else (_pose_points(plan), [])
    counts = sorted({len(q) for q, _ in points})
    if len(counts) != 1:
        raise InputError(f"{path}: its poses have {' and '.join(map(str, counts))} joint angles; all need the same")
    balls = {p.id: p.ball for p in plan.poses if p.ball is not None}
    visits = [BallVisit(visit, balls[visit], k) for k, (_, visit) in enumerate(points) if visit in balls]
    _check(path, visits, balls)
    return PlannedPath(
        plan.plan_id, plan.robot, read_only(from_deg([q for q, _ in points])), tuple(visits), tuple(joined)
    )


def _drive_points(plan: PlanDocument) -> tuple[list[tuple[tuple[float, ...], int]], list[tuple[int, int]]]:
    """Points of the drives, and which the plan's shortcuts join; the travel's last point is the first one measured."""
    points: list[tuple[tuple[float, ...], int]] = []
    joined: list[tuple[int, int]] = []
    for drive in plan.drives:
        at: list[int] = []
        for point in (*drive.travel, *drive.waypoints):
            if points and points[-1][0] == point.q_deg:
                points[-1] = (point.q_deg, max(point.visit, points[-1][1]))
            else:
                points.append((point.q_deg, point.visit))
            at.append(len(points) - 1)
        measuring = at[len(drive.travel) :]
        joined += [(measuring[0], measuring[k]) for k in drive.shortcuts if k < len(measuring)]
    return points, joined


def _pose_points(plan: PlanDocument) -> list[tuple[tuple[float, ...], int]]:
    """Poses with the support poses that follow each."""
    points: list[tuple[tuple[float, ...], int]] = []
    for pose in plan.poses:
        points += [(pose.q_deg, pose.id)] + [(s.q_deg, -1) for s in plan.supports if s.after == pose.id]
    return points


def _check(path: Path, visits: list[BallVisit], balls: dict[int, str]) -> None:
    found = [v.id for v in visits]
    if not balls:
        raise InputError(f"{path}: no pose names a ball; a centring needs a plan for the gauge trical")
    if missing := sorted(set(balls) - set(found)):
        raise InputError(f"{path}: the path passes no pose {', '.join(map(str, missing[:5]))}")
    if len(set(found)) < len(found):
        twice = next(i for i in found if found.count(i) > 1)
        raise InputError(f"{path}: pose {twice} is driven to twice; each measured pose has its own id")
    for before, after in pairwise(visits):
        if after.at == before.at + 1:
            raise InputError(
                f"{path}: pose {after.id} follows pose {before.id} with no path between that "
                "takes the head off the ball"
            )


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
