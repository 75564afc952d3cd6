"""From files to one checked run: quantities found, sessions numbered, several files joined."""

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from planner.common.errors import InputError
from planner.common.units import Array, read_only
from planner.runs.joint_motion import check_order, looks_continuous, number_sessions
from planner.runs.quantities import (
    check_jumps,
    index_names,
    joint_angles,
    joint_array,
    reading_kind,
    readings_of,
    sorted_names,
)
from planner.runs.rests import average_rests, marks_rests
from planner.runs.run import IntArray, Readings, Run, Samples
from planner.runs.synchronisation import pair_tables
from planner.runs.table import RunTable, read_table

MEASURES = ("static", "continuous")


def load_run(path: Path, n_joints: int) -> Run:
    """Load one run of an arm with ``n_joints`` joints from ``.csv`` or ``.parquet``.

    Raises:
        InputError: with file, line and column of the first thing that is wrong.
    """
    return run_of(read_table(Path(path), n_joints), n_joints)


def run_of(table: RunTable, n_joints: int) -> Run:
    """Return the run that a table holds; where a log runs on through poses at rest, one sample for each rest.

    Poses at rest are recognised by ``# measure: static`` or by numbers of poses in which the arm stands still.

    Raises:
        InputError: joints or reading are missing, the clock is wrong, or the arm never rests.
    """
    run = _logged_run(table, n_joints)
    said = table.note("measure")
    if looks_continuous(run.samples.t, run.samples.q) and (said == "static" or (said is None and marks_rests(run))):
        return average_rests(run)
    t, session = run.samples.t, run.samples.session
    if run.continuous and t is not None and session is not None:
        check_order(table.source, t, session if table.has("session") else np.zeros_like(session))
        check_jumps(table, n_joints)
    return run


def _logged_run(table: RunTable, n_joints: int) -> Run:
    """Return the run with every row a sample.

    Raises:
        InputError: joints or reading are missing, or the clock is wrong.
    """
    q_read, odd = joint_angles(table, "q", n_joints)
    q_cmd, odd_cmd = joint_angles(table, "cmd", n_joints)
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
        q=read_only(q),
        place=place,
        t=None if t is None else read_only(t),
        q_cmd=None if q_cmd is None else read_only(q_cmd),
        q_read=None if q_read is None else read_only(q_read),
        session=session,
        pose=_whole(table, "pose"),
        point=point if table.has("point") else None,
        temperature=_column(table, "temperature"),
        force=_column(table, "force"),
        torque=_joints(table, "torque", n_joints),
        payload=_column(table, "payload"),
        direction=_joints(table, "direction", n_joints),
        file=_read_only_numbers(np.zeros(table.frame.height, dtype=np.int64)),
        line=_read_only_numbers(table.source.numbers(table.frame.height)),
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


def _is_continuous(table: RunTable, t: Array | None, q: Array) -> bool:
    """Return what the file says of itself, or else what its time and movement look like."""
    said = table.note("measure")
    if said is None:
        return looks_continuous(t, q)
    if said not in MEASURES:
        raise InputError(f"{table.source.file}: '# measure: {said}' is unknown; static or continuous is allowed")
    if said == "continuous" and t is None:
        raise InputError(f"{table.source.file}: the run is said to be continuous, but there is no column t_s")
    return said == "continuous"


def _sessions(table: RunTable, t: Array | None) -> tuple[IntArray, list[str]]:
    """Return the session of each sample, and a warning where the clock decided it."""
    given = table.array("session") if table.has("session") else None
    session, back = number_sessions(t, given, table.frame.height)
    session.setflags(write=False)
    if len(back) == 0:
        return session, []
    lines = ", ".join(table.source.at(int(row)).rpartition(", ")[2] for row in back[:3])
    more = f" and {len(back) - 3} more" if len(back) > 3 else ""
    result = "a new session begins at each" if given is None else "within a session; its number was kept"
    return session, [f"{table.source.name}: the clock steps back {_times(len(back))} ({lines}{more}): {result}"]


def _times(n: int) -> str:
    return f"{n} time" + "s" * (n > 1)


def _names(table: RunTable, key: str, otherwise: str) -> tuple[IntArray, tuple[str, ...]]:
    if table.has(key):
        return index_names(table.frame[key].to_list())
    return _read_only_numbers(np.zeros(table.frame.height, dtype=np.int64)), (otherwise,)


def _column(table: RunTable, key: str) -> Array | None:
    return read_only(table.array(key)) if table.has(key) else None


def _joints(table: RunTable, stem: str, n_joints: int) -> Array | None:
    values = joint_array(table, stem, n_joints)
    return None if values is None else read_only(values)


def _whole(table: RunTable, key: str) -> IntArray | None:
    """Return a column of whole numbers; a blank is −1."""
    if not table.has(key):
        return None
    return _read_only_numbers(np.asarray(table.frame[key].fill_null(-1.0).to_numpy()).astype(np.int64))


def _read_only_numbers(numbers: IntArray) -> IntArray:
    numbers.setflags(write=False)
    return numbers


def load_runs(paths: Sequence[Path], n_joints: int) -> Run:
    """Load several files as one run; each begins a new session and, unless it names fixtures, a new placement.

    A file with readings but no angles is the gauge's own log and is joined with the one that has angles but no
    readings (see `planner.runs.synchronisation`).

    Raises:
        InputError: a file is wrong, or they do not read the same kind of gauge.
    """
    if not paths:
        raise InputError("no run was given; name one or more files, .csv or .parquet")
    files = [Path(path) for path in paths]
    for i, file in enumerate(files):
        if file.resolve() in (other.resolve() for other in files[:i]):
            raise InputError(f"{file} is given twice; the same samples would count as new ones")
    runs = [run_of(table, n_joints) for table in pair_tables([read_table(file, n_joints) for file in files])]
    return join_runs(_distinguish_names(runs, files))


def _distinguish_names(runs: Sequence[Run], files: Sequence[Path]) -> list[Run]:
    """Return runs whose files have one name in different folders under the names of both, so that placements differ."""
    names = [run.name for run in runs]
    folders = {file.stem: [f.resolve().parent.name for f in files if f.stem == file.stem] for file in files}
    result = []
    for i, run in enumerate(runs):
        if names.count(run.name) == 1:
            result.append(run)
            continue
        name = f"{folders[run.name][names[:i].count(run.name)]}/{run.name}"
        named = tuple(f"{Path(name).parent}/{file}" for file in run.files)
        places = (name,) if run.places == (run.name,) else run.places
        result.append(replace(run, name=name, places=places, files=named))
    return result


def join_runs(runs: Sequence[Run]) -> Run:
    """Return one run of all samples in the order given.

    Raises:
        InputError: the runs differ in kind of reading, in static or continuous, or in robot.
    """
    if len(runs) == 1:
        return runs[0]
    _check_same([reading_kind(r.readings) for r in runs], runs, "reads {}")
    _check_same(["continuous" if r.continuous else "static" for r in runs], runs, "is {}", _hint_for_loaded(runs))
    _check_same(
        [r.robot for r in runs if r.robot is not None], [r for r in runs if r.robot is not None], "is of the robot {}"
    )
    warnings = [w for r in runs for w in r.warnings]
    if runs[0].readings.position is not None:  # a tracker may have been set up anew between two files
        runs = [replace(r, places=(r.name,)) if r.places == ("",) else r for r in runs]
    places = tuple(dict.fromkeys(name for r in runs for name in r.places))
    balls, points = (sorted_names({n for r in runs for n in getattr(r, key)}) for key in ("balls", "points"))
    samples = _join_samples(runs, places, points, warnings)
    plans = {r.plan_id for r in runs}
    if len(plans) > 1:
        warnings.append(
            "the files belong to different plans: " + ", ".join(f"{r.name} to {r.plan_id or 'none'}" for r in runs)
        )
    return Run(
        "+".join(r.name for r in runs),
        samples,
        _join_readings(runs, balls, warnings),
        places,
        balls,
        points,
        runs[0].continuous,
        max(r.clocks for r in runs),
        runs[0].plan_id if len(plans) == 1 else None,
        next((r.robot for r in runs if r.robot is not None), None),
        tuple(warnings),
        tuple(file for r in runs for file in r.files),
    )


def _hint_for_loaded(runs: Sequence[Run]) -> str:
    """What would help where circles under load were logged as they were driven, beside a run at rest."""
    raw = [r.name for r in runs if r.continuous and r.samples.force is not None]
    if not raw:
        return ""
    return f"; edbb loaded brings {raw[0]} into a static run, averaged.csv, or fits both at once (--with)"


def _check_same(values: Sequence[str], runs: Sequence[Run], text: str, more: str = "") -> None:
    for value, run in zip(values, runs, strict=True):
        if value != values[0]:
            raise InputError(
                f"{run.name} {text.format(value)}, but {runs[0].name} {text.format(values[0])}; "
                f"only runs of one kind are joined{more}"
            )


def _join_samples(
    runs: Sequence[Run], places: tuple[str, ...], points: tuple[str, ...], warnings: list[str]
) -> Samples:
    """Join what is logged in all files; warn of what is logged in some."""
    parts: dict[str, Array | IntArray | None] = {}
    runs = _fill_missing_force(runs, warnings)
    for name in (f.name for f in fields(Samples)):
        parts[name] = _all_or_none(name, runs, [getattr(r.samples, name) for r in runs], warnings)
    if parts["file"] is not None:
        first = np.cumsum([0, *(len(r.files) for r in runs[:-1])])
        parts["file"] = _read_only(parts["file"] + np.repeat(first, [len(r) for r in runs]))
    parts["place"] = _reindex([r.samples.place for r in runs], [r.places for r in runs], places)
    if len(points) > 1:
        zeros = [r.samples.point if r.samples.point is not None else np.zeros(len(r), dtype=np.int64) for r in runs]
        parts["point"] = _reindex(zeros, [r.points for r in runs], points)
    offset, numbered = 0, []
    for r in runs:
        session = r.samples.session if r.samples.session is not None else np.zeros(len(r), dtype=np.int64)
        numbered.append(session + offset)
        offset = int(numbered[-1].max()) + 1
    parts["session"] = _read_only(np.concatenate(numbered))
    return Samples(**parts)  # type: ignore[arg-type]


def _fill_missing_force(runs: Sequence[Run], warnings: list[str]) -> list[Run]:
    """Return the runs with no pull of the bar where none was logged but others log one."""
    lacking = [r.name for r in runs if r.samples.force is None]
    if not 0 < len(lacking) < len(runs):
        return list(runs)
    warnings.append(f"force is not logged in {', '.join(lacking)}: taken as no pull of the bar")
    return [
        replace(r, samples=replace(r.samples, force=_read_only(np.zeros(len(r))))) if r.samples.force is None else r
        for r in runs
    ]


def _join_readings(runs: Sequence[Run], balls: tuple[str, ...], warnings: list[str]) -> Readings:
    parts = {
        f.name: _all_or_none(f.name, runs, [getattr(r.readings, f.name) for r in runs], warnings)
        for f in fields(Readings)
    }
    if balls:
        parts["ball"] = _reindex(
            [r.readings.ball for r in runs if r.readings.ball is not None], [r.balls for r in runs], balls
        )
    return Readings(**parts)


def _all_or_none(name: str, runs: Sequence[Run], values: Sequence[Array | None], warnings: list[str]) -> Array | None:
    there = [v for v in values if v is not None]
    if len(there) == len(values):
        return _read_only(np.concatenate(there))
    if there and name not in ("session", "point", "file", "line"):
        lacking = ", ".join(r.name for r, v in zip(runs, values, strict=True) if v is None)
        warnings.append(f"{name} is not logged in {lacking}, so it was left out of the other files too")
    return None


def _reindex(parts: Sequence[IntArray], names: Sequence[tuple[str, ...]], common: tuple[str, ...]) -> IntArray:
    """Return indices into ``common`` of what each part counts in its own names."""
    return _read_only(
        np.concatenate([np.array([common.index(n) for n in own])[p] for p, own in zip(parts, names, strict=True)])
    )


def _read_only(array: Array) -> Array:
    array.setflags(write=False)
    return array
