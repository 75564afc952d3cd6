"""One ball: centred, and written as a row of the run."""

import time

import numpy as np
from scipy.spatial.transform import Rotation

from planner.centring.bench import Bench, Session
from planner.centring.centre import Centred, centre
from planner.centring.course import Visit
from planner.centring.journal import Journal, Row
from planner.units import Array, from_deg, to_deg, to_mm

Triple = tuple[float, float, float]


def measured(session: Session, visit: Visit, number: int, bench: Bench) -> tuple[Row, Centred]:
    """Centre a ball that the head touches, and note where the arm then stands; ``number`` is that of the session.

    Raises:
        CentringError: see :func:`planner.centring.centre.centre`.
    """
    done = centre(bench.indicators, bench.link, bench.settings, bench.stop)
    q, cmd = bench.link.joints()
    row = Row(
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


def told(row: Row) -> str:
    """Return a row in a line for the person at the cell."""
    left = ", ".join(f"{1e3 * v:+.1f}" for v in row.reading_mm)
    off = np.linalg.norm(row.found_mm)
    return f"pose {row.pose} on ball {row.ball}: {off:.2f} mm off, {row.moves} moves, {left} µm left"


def _offset(done: Centred, bench: Bench) -> Triple:
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
