"""One session: every pose of the plan that is not measured yet is approached, centred, recorded and left."""

import time
from pathlib import Path

import numpy as np

from planner.centring.bench import Bench, Session
from planner.centring.course import read_way
from planner.centring.errors import CentringError
from planner.centring.journal import journal_path, open_journal
from planner.centring.measuring import measured, told
from planner.centring.riding import driven, followed
from planner.units import MM, Array


def open_session(plan_file: Path, output: Path) -> Session:
    """Open the session of a plan, or go on with the one that was begun in ``output``.

    Raises:
        InputError: no plan with balls, or ``output`` belongs to something else.
    """
    way = read_way(plan_file)
    return Session(way, open_journal(output, way, time.time()))


def run_session(session: Session, bench: Bench, follow: bool = False) -> None:
    """Measure what is left; whatever happens, the robot is stopped and what was measured is kept.

    The planner drives the robot; with ``follow`` the plan's own program does, and calls at each ball.

    Raises:
        CentringError: with the pose at which it happened, and how to go on.
    """
    number = session.journal.session
    try:
        for visit in (followed if follow else driven)(session, bench):
            row, done = measured(session, visit, number, bench)
            session.journal.add(row)
            bench.say(told(row))
            if not follow:  # the plan's own program wants the arm where the ball is
                _back(bench, done.moved)
    except CentringError as err:
        bench.link.stop()
        raise type(err)(_sentence(session, bench.place.text, err)) from err
    except BaseException:
        bench.link.stop()
        raise


def _back(bench: Bench, moved: Array) -> None:
    """Undo the ``moved`` (3,) [m] of a centring: from the planned pose the way is known."""
    parts = int(np.ceil(np.linalg.norm(moved) / (bench.settings.moves.step_mm * MM)))
    for _ in range(parts):
        bench.link.shift(-moved / parts)


def _sentence(session: Session, where: str, err: CentringError) -> str:
    count, of = len(session.journal.measured), len(session.way.visits)
    return (
        f"{where}: {err}; {count} of {of} poses are kept in {journal_path(session.output).name}, "
        "the same command goes on from there"
    )
