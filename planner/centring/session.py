"""A centring session: each pose that is left is approached, centred, recorded and left."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from planner.centring.indicators import Indicators, read_settled_indicators
from planner.centring.journal import (
    BallVisit,
    Journal,
    JournalRow,
    PlannedPath,
    journal_path,
    open_journal,
    read_planned_path,
)
from planner.centring.procedure import CentredBall, centre_ball, check_free
from planner.centring.robot_link import RobotLink
from planner.centring.settings import CentringSettings
from planner.centring.stop import CentringError, LinkError, StopRequest
from planner.common.units import MM, Array, from_deg, to_deg, to_mm

Notify = Callable[[str], None]


class CentringAdviser(Protocol):
    """Says of each ball whether it need not be centred, and after each where the session stands."""

    def passes(self, pose: int) -> str:
        """Return why the pose of this id need not be centred; empty where it is to be."""

    def advise(self, row: JournalRow) -> str:
        """Return where the session stands after a ball; empty where nothing is to be said."""


class NoCentringAdvice:
    """All balls are centred, and nothing is said of them."""

    def passes(self, pose: int) -> str:
        """Return nothing."""
        return ""

    def advise(self, row: JournalRow) -> str:
        """Return nothing."""
        return ""


@dataclass
class CentringBench:
    """Indicators, robot, limits, the stop that all look at, who is told and who advises, and where the robot is."""

    indicators: Indicators
    link: RobotLink
    settings: CentringSettings
    stop: StopRequest
    say: Notify
    place: str = "at the start"
    adviser: CentringAdviser = field(default_factory=NoCentringAdvice)

    def skips(self, visit: BallVisit) -> bool:
        """Tell whether a ball need not be centred, and say why."""
        if why := self.adviser.passes(visit.id):
            self.say(f"pose {visit.id} on ball {visit.ball}: passed by, {why}")
        return bool(why)


@dataclass(frozen=True)
class CentringSession:
    """A plan, and what is measured of it so far."""

    way: PlannedPath
    journal: Journal

    @property
    def pending_visits(self) -> list[BallVisit]:
        """The poses that are left, in the order driven."""
        return [v for v in self.way.visits if v.id not in self.journal.measured_ids]

    @property
    def output(self) -> Path:
        """Path of the run's file."""
        return self.journal.output


Triple = tuple[float, float, float]


def measure_ball(
    session: CentringSession, visit: BallVisit, number: int, bench: CentringBench
) -> tuple[JournalRow, CentredBall]:
    """Centre a ball that the head touches, and note where the arm then stands; ``number`` is that of the session.

    Raises:
        CentringError: see :func:`planner.centring.procedure.centre_ball`.
    """
    done = centre_ball(bench.indicators, bench.link, bench.settings, bench.stop)
    q, cmd = bench.link.joints()
    row = JournalRow(
        pose=visit.id,
        ball=visit.ball,
        session=number,
        t_s=_time(session.journal),
        q_deg=_degrees(q),
        cmd_deg=_degrees(cmd),
        offset_mm=_offset(done, bench),
        reading_mm=_millimetres(done.reading),
        found_mm=_millimetres(done.found),
        moves=done.moves,
    )
    return row, done


def row_text(row: JournalRow) -> str:
    """Return a row in a line for the person at the cell."""
    left = ", ".join(f"{1e3 * v:+.1f}" for v in row.reading_mm)
    off = np.linalg.norm(row.found_mm)
    return f"pose {row.pose} on ball {row.ball}: {off:.2f} mm off, {row.moves} moves, {left} µm left"


def _offset(done: CentredBall, bench: CentringBench) -> Triple:
    """Tool point less ball centre, in the plate's axes."""
    R_BP = Rotation.from_euler("xyz", from_deg(bench.settings.robot.plate_rpy_deg)).as_matrix()
    return _millimetres(-R_BP.T @ bench.link.orientation() @ done.p_TB)


def _time(journal: Journal) -> float:
    """Seconds since the first session began; a clock that was set back does not turn the order of the rows round."""
    last = journal.rows[-1].t_s if journal.rows else 0.0
    return round(max(time.time() - journal.head.began_s, last + 1e-3), 3)


def _degrees(angles: Array) -> tuple[float, ...]:
    return tuple(round(float(a), 6) for a in to_deg(angles))


def _millimetres(vector: Array) -> Triple:
    x, y, z = (round(float(v), 6) + 0.0 for v in to_mm(vector))
    return x, y, z


def drive_to_balls(session: CentringSession, bench: CentringBench) -> Iterator[BallVisit]:
    """Drive the planned way, backward where that is where the rest lies, and end at its end.

    Raises:
        LinkError: the robot stands off the way, or does not move.
        ContactError: an indicator is stuck before it touches.
    """
    way, settings = session.way, bench.settings
    at = _go_to_path(way, bench)
    for visit in session.pending_visits:
        if bench.skips(visit):
            continue
        bench.place = _visit_text(visit)
        off_ball = way.approach_point(visit, at)
        _drive(way.points_to_drive(at, off_ball), way, bench)
        if settings.head.check_free:
            check_free(read_settled_indicators(bench.indicators, settings.rest, bench.stop), settings.head)
        _drive([off_ball, visit.at], way, bench)
        at = visit.at
        yield visit
    bench.place = "on the way back"
    _drive(way.points_to_drive(at, len(way.q) - 1), way, bench)


def follow_program(session: CentringSession, bench: CentringBench) -> Iterator[BallVisit]:
    """Wait for the plan's own program to come to its balls; those that are measured are left at once.

    Raises:
        LinkError: the program does not come, or is another plan's.
    """
    visits, left = {v.id: v for v in session.way.visits}, {v.id for v in session.pending_visits}
    while left:
        bench.place = "waiting for the robot's program"
        pose = bench.link.arrive()
        visit = visits.get(pose)
        if visit is None:
            raise LinkError(f"the robot's program is at pose {pose}, which this plan has not: is it another's?")
        bench.place = _visit_text(visit)
        off = float(np.abs(to_deg(bench.link.joints()[1] - session.way.q[visit.at])).max())
        if off > bench.settings.robot.arrived_deg:
            raise LinkError(
                f"the robot's program stands {off:.3f} deg away from pose {pose} of this plan: is it another's?"
            )
        if visit.id in left and not bench.skips(visit):
            yield visit
        left.discard(visit.id)
        bench.link.release()


def _go_to_path(way: PlannedPath, bench: CentringBench) -> int:
    """Bring the robot to the point of the way that is nearest, and return that.

    Raises:
        LinkError: it stands elsewhere; the way from there is not known to be free.
    """
    at, off = way.nearest_point(bench.link.joints()[1])
    if float(to_deg(off)) > bench.settings.robot.start_deg:
        first = ", ".join(f"{a:.2f}" for a in to_deg(way.q[0]))
        raise LinkError(
            f"the robot stands {float(to_deg(off)):.1f} deg away from the planned path, and the path to it was never "
            f"checked. Take it by hand to the start of the path ({first} deg)"
        )
    bench.link.move(way.q[at], slow=True)
    return at


def _drive(points: list[int], way: PlannedPath, bench: CentringBench) -> None:
    """Drive from the first of the points on; slowly where one end of a leg is a ball."""
    balls = {v.at for v in way.visits}
    for before, point in pairwise(points):
        bench.link.move(way.q[point], slow=before in balls or point in balls)


def _visit_text(visit: BallVisit) -> str:
    return f"at pose {visit.id} on ball {visit.ball}"


def open_session(plan_file: Path, output: Path) -> CentringSession:
    """Open the session of a plan, or go on with the one that was begun in ``output``.

    Raises:
        InputError: no plan with balls, or ``output`` belongs to something else.
    """
    way = read_planned_path(plan_file)
    return CentringSession(way, open_journal(output, way, time.time()))


def run_session(session: CentringSession, bench: CentringBench, follow: bool = False) -> None:
    """Measure what is left; whatever happens, the robot is stopped and what was measured is kept.

    The planner drives the robot; with ``follow`` the plan's own program does, and calls at each ball.

    Raises:
        CentringError: with the pose at which it happened, and how to go on.
    """
    number = session.journal.session
    try:
        for visit in (follow_program if follow else drive_to_balls)(session, bench):
            row, done = measure_ball(session, visit, number, bench)
            session.journal.add(row)
            stands = bench.adviser.advise(row)
            bench.say(f"{row_text(row)}{'; ' if stands else ''}{stands}")
            if not follow:  # the plan's own program wants the arm where the ball is
                _undo_shift(bench, done.moved)
    except CentringError as err:
        bench.link.stop()
        raise type(err)(_stop_message(session, bench.place, err)) from err
    except BaseException:
        bench.link.stop()
        raise


def _undo_shift(bench: CentringBench, moved: Array) -> None:
    """Undo the ``moved`` (3,) [m] of a centring: from the planned pose the way is known."""
    parts = int(np.ceil(np.linalg.norm(moved) / (bench.settings.moves.step_mm * MM)))
    for _ in range(parts):
        bench.link.shift(-moved / parts)


def _stop_message(session: CentringSession, where: str, err: CentringError) -> str:
    count, of = len(session.journal.measured_ids), len(session.way.visits)
    return (
        f"{where}: {err}; {count} of {of} poses are kept in {journal_path(session.output).name}, "
        "the same command goes on from there"
    )
