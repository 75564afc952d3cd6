"""From files to one checked run: each quantity found, sessions numbered, places named."""

from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.run.clock import check_order, looks_continuous, sessions
from planner.run.joints import angles, check_jumps, joint_array
from planner.run.reading import indexed, readings_of
from planner.run.resting import marks_rests, rest
from planner.run.table import Table, read_table
from planner.run.types import IntArray, Run, Samples
from planner.units import Array, frozen

MEASURES = ("static", "continuous")


def load_run(path: Path, n_joints: int) -> Run:
    """Load one run of an arm with ``n_joints`` joints from ``.csv`` or ``.parquet``.

    Raises:
        InputError: with file, line and column of the first thing that is wrong.
    """
    return run_of(read_table(Path(path), n_joints), n_joints)


def run_of(table: Table, n_joints: int) -> Run:
    """Return the run that a table holds; where a log runs on through poses at rest, one sample for each rest.

    Poses at rest are recognised by ``# measure: static`` or by numbers of poses in which the arm stands still.

    Raises:
        InputError: joints or reading are missing, the clock is wrong, or the arm never rests.
    """
    run = _as_logged(table, n_joints)
    said = table.note("measure")
    if looks_continuous(run.samples.t, run.samples.q) and (said == "static" or (said is None and marks_rests(run))):
        return rest(run)
    t, session = run.samples.t, run.samples.session
    if run.continuous and t is not None and session is not None:
        check_order(table.source, t, session if table.has("session") else np.zeros_like(session))
        check_jumps(table, n_joints)
    return run


def _as_logged(table: Table, n_joints: int) -> Run:
    """Return the run with every row a sample.

    Raises:
        InputError: joints or reading are missing, or the clock is wrong.
    """
    q_read, odd = angles(table, "q", n_joints)
    q_cmd, odd_cmd = angles(table, "cmd", n_joints)
    q = q_read if q_read is not None else q_cmd
    if q is None:
        raise InputError(
            f"{table.source.file}: there are no joint angles; "
            f"q1_deg … q{n_joints}_deg (as read) or cmd1_deg … (as commanded) are needed"
        )
    readings, balls = readings_of(table)
    t = table.array("t") if table.has("t") else None
    continuous = _is_continuous(table, t, q)
    session, said = _sessions(table, t)
    place, places = _names(table, "fixture", table.stem if readings.ball is not None else "")
    point, points = _names(table, "point", "")
    samples = Samples(
        q=frozen(q),
        place=place,
        t=None if t is None else frozen(t),
        q_cmd=None if q_cmd is None else frozen(q_cmd),
        q_read=None if q_read is None else frozen(q_read),
        session=session,
        pose=_whole(table, "pose"),
        point=point if table.has("point") else None,
        temperature=_column(table, "temperature"),
        force=_column(table, "force"),
        torque=_joints(table, "torque", n_joints),
        payload=_column(table, "payload"),
        direction=_joints(table, "direction", n_joints),
        file=_locked(np.zeros(table.frame.height, dtype=np.int64)),
        line=_locked(table.source.numbers(table.frame.height)),
    )
    warnings = (*table.warnings, *odd, *odd_cmd, *said)
    return Run(
        table.stem,
        samples,
        readings,
        places,
        balls,
        points,
        continuous,
        2 if table.note("clocks") == "2" else 1,
        table.note("plan_id"),
        table.note("robot"),
        warnings,
        (table.source.name,),
    )


def _is_continuous(table: Table, t: Array | None, q: Array) -> bool:
    """Return what the file says of itself, or else what its time and movement look like."""
    said = table.note("measure")
    if said is None:
        return looks_continuous(t, q)
    if said not in MEASURES:
        raise InputError(f"{table.source.file}: '# measure: {said}' is unknown; static or continuous is allowed")
    if said == "continuous" and t is None:
        raise InputError(f"{table.source.file}: the run is said to be continuous, but there is no column t_s")
    return said == "continuous"


def _sessions(table: Table, t: Array | None) -> tuple[IntArray, list[str]]:
    """Return the session of each sample, and a warning where the clock decided it."""
    given = table.array("session") if table.has("session") else None
    session, back = sessions(t, given, table.frame.height)
    session.setflags(write=False)
    if len(back) == 0:
        return session, []
    lines = ", ".join(table.source.at(int(row)).rpartition(", ")[2] for row in back[:3])
    more = f" and {len(back) - 3} more" if len(back) > 3 else ""
    result = "a new session begins at each" if given is None else "within a session; its number was kept"
    return session, [f"{table.source.name}: the clock steps back {_times(len(back))} ({lines}{more}): {result}"]


def _times(n: int) -> str:
    return f"{n} time" + "s" * (n > 1)


def _names(table: Table, key: str, otherwise: str) -> tuple[IntArray, tuple[str, ...]]:
    if table.has(key):
        return indexed(table.frame[key].to_list())
    return _locked(np.zeros(table.frame.height, dtype=np.int64)), (otherwise,)


def _column(table: Table, key: str) -> Array | None:
    return frozen(table.array(key)) if table.has(key) else None


def _joints(table: Table, stem: str, n_joints: int) -> Array | None:
    values = joint_array(table, stem, n_joints)
    return None if values is None else frozen(values)


def _whole(table: Table, key: str) -> IntArray | None:
    """Return a column of whole numbers; a blank is −1."""
    if not table.has(key):
        return None
    return _locked(np.asarray(table.frame[key].fill_null(-1.0).to_numpy()).astype(np.int64))


def _locked(numbers: IntArray) -> IntArray:
    numbers.setflags(write=False)
    return numbers
