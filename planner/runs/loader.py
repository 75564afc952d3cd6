"""From files to one checked run: quantities found, sessions numbered, several files joined.

Readings that stand twice: a file that is given as two, rows that were pasted again.
"""

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from planner.common.advice import Occasion, advice
from planner.common.errors import InputError
from planner.common.summary import Aside
from planner.common.units import Array, IntArray, read_only
from planner.runs.images import pad_corners, split_images
from planner.runs.joint_motion import (
    average_rests,
    check_order,
    go_on_past_turns,
    is_dense,
    looks_continuous,
    marks_rests,
    number_sessions,
)
from planner.runs.model_axes import AxesOf, in_model_axes
from planner.runs.quantities import check_jumps, joint_angles, readings_of, turns_as
from planner.runs.run import Readings, Run, Samples, sort_names
from planner.runs.synchronisation import pair_tables
from planner.runs.table import RunTable, read_table


def refuse_repeated_files(files: Sequence[Path]) -> None:
    """Refuse a file that is given twice, by its own name or as a copy.

    Raises:
        InputError: naming it, and the other.
    """
    for i, file in enumerate(files):
        for other in files[:i]:
            if file.resolve() == other.resolve():
                raise InputError(f"{file} is given twice; the same samples would count as new ones")
            if _is_copy(file, other):
                raise InputError(
                    f"{file} is a copy of {other}, byte for byte; the same samples would count as new ones"
                )


def _is_copy(file: Path, other: Path) -> bool:
    fewest = 10  # lines from which on two files cannot agree by chance
    both = file.is_file() and other.is_file() and file.stat().st_size == other.stat().st_size
    return both and (found := file.read_bytes()) == other.read_bytes() and found.count(b"\n") >= fewest


def repeated_row_notes(run: Run) -> Iterator[str]:
    """Say which rows of a run at rest repeat earlier ones, joints and reading, where too many do for chance.

    A gauge that is read again at a pose shows another last digit at some of them.
    """
    values = run.readings.length if run.readings.length is not None else run.readings.position
    if run.continuous or values is None:
        return
    rows = np.column_stack([run.samples.q, values.reshape(len(run), -1), run.samples.place, run.samples.point_numbers])
    _, first, which = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    earlier = first[which.ravel()]
    copies = np.flatnonzero(earlier < np.arange(len(run)))
    _, pose = np.unique(run.samples.q, axis=0, return_inverse=True)
    again = len(run) - len(np.unique(pose))  # rows at poses that were read before
    fewest = 5  # rows from which on it is no chance
    if len(copies) >= fewest and len(copies) == again:
        k = copies[0]
        yield (
            f"{len(copies)} rows repeat earlier ones in each digit of joints and reading, the first {run.where(k)} "
            f"that of {run.where(earlier[k])}: were they pasted twice? Each counts as a reading of its own"
        )


FEWEST_ROWS = 3  # that share a time, or at which it steps back: fewer may be a slip
MEASURES = ("static", "continuous")
OF_CORNERS = frozenset({"pixels", "seen"})  # of as many corners as a file names
UNNAMED = frozenset({"turns", "session", "point", "file", "line", "seen"})  # left out of a joined run without a word
T = TypeVar("T", Samples, Readings)


def load_run(path: Path | str, n_joints: int = 6, axes_of: AxesOf | None = None) -> Run:
    """Load one run of an arm with ``n_joints`` joints from ``.csv`` or ``.parquet``.

    ``axes_of``: how the robot's controllers count, for files whose angles are a controller's (``# axes_of: pdl2``).

    Raises:
        InputError: with file, line and column of the first thing that is wrong.

    Example:
        >>> load_run("run.csv").readings.length  # (n,) m, of a bar or wire  # doctest: +SKIP
    """
    return run_of(in_model_axes(read_table(Path(path), n_joints), axes_of), n_joints)


def run_of(table: RunTable, n_joints: int) -> Run:
    """Return the run that a table holds; where a log runs on through poses at rest, one sample for each rest.

    Poses at rest are recognised by ``# measure: static`` or by numbers of poses in which the arm stands still.

    Raises:
        InputError: joints or reading are missing, the clock is wrong, or the arm never rests.
    """
    table, pixels = split_images(go_on_past_turns(table))
    run = _logged_run(table, n_joints, pixels)
    _check_clock(table, run)
    said = table.notes.get("measure")
    if is_dense(run.samples.t, run.samples.q) and (said == "static" or (said is None and marks_rests(run))):
        return average_rests(run)
    if run.continuous and run.samples.t is not None:
        session = run.samples.session_numbers
        check_order(table.source, run.samples.t, session if table.has("session") else np.zeros_like(session))
        check_jumps(table, n_joints)
    return run


def _check_clock(table: RunTable, run: Run) -> None:
    """Refuse a clock that stands while the arm moves.

    Raises:
        InputError: one time for poses far from each other.
    """
    t, q = run.samples.t, run.samples.q
    # 1e-3: [rad] that rows cannot have moved by in no time
    if t is None or len(t) < FEWEST_ROWS or np.ptp(t) > 0.0 or np.ptp(q, axis=0).max() < 1e-3:
        return
    raise table.source.error(
        0, "t", f"all {len(t)} rows have the time {t[0]:g} s, but the arm moves between them; leave the column out, or "
        "log the clock"
    )  # fmt: skip


def _logged_run(table: RunTable, n_joints: int, pixels: Array | None) -> Run:
    """Return the run with every row a sample; ``pixels`` (n, K, 2) [px] of a run of images.

    Raises:
        InputError: joints or reading are missing, or the clock is wrong.
    """
    q_read = joint_angles(table, "q", n_joints)
    q_cmd = joint_angles(table, "cmd", n_joints)
    q = q_read if q_read is not None else q_cmd
    if q is None:
        raise InputError(
            f"{table.source.file}: there are no joint angles; "
            f"q1_deg …{f' q{n_joints}_deg' if n_joints else ''} (as read) or cmd1_deg … (as commanded) are needed"
        )
    readings, balls = readings_of(table, pixels)
    t = table.optional_column("t")
    continuous = _is_continuous(table, t, q)
    session, said = _sessions(table, t)
    said += _note_of_drive(table, t, q) if continuous else []
    place, places = table.names("fixture", table.stem if readings.ball is not None else "")
    point, points = table.names("point")
    samples = Samples(
        q=q,
        place=place,
        t=t,
        q_cmd=q_cmd,
        q_read=q_read,
        session=session,
        pose=read_only(table.frame["pose"].fill_null(-1.0), np.int64) if table.has("pose") else None,
        point=point if table.has("point") else None,
        temperature=table.optional_column("temperature"),
        force=table.optional_column("force"),
        torque=table.joints("torque", n_joints),
        payload=table.optional_column("payload"),
        direction=table.joints("direction", n_joints),
        file=read_only(np.zeros(len(q)), np.int64),
        line=read_only(table.source.lines, np.int64),
        seen=None if pixels is None else read_only(~np.isnan(pixels[..., 0]), bool),
    )
    return Run(
        table.stem,
        samples,
        readings,
        places,
        balls,
        points,
        continuous,
        2 if table.notes.get("clocks") == "2" else 1,
        table.notes.get("plan_id"),
        table.notes.get("robot"),
        (*table.warnings, *said),
        (table.source.name,),
        "truth" in table.notes,
        table.slides,
        turns_as(table),
    )


def _is_continuous(table: RunTable, t: Array | None, q: Array) -> bool:
    """Return what the file says of itself, or else what its time and movement look like."""
    said = table.notes.get("measure")
    if said is None:
        return looks_continuous(t, q)
    if said not in MEASURES:
        raise InputError(f"{table.source.file}: '# measure: {said}' is unknown; static or continuous is allowed")
    if said == "continuous" and t is None:
        raise InputError(f"{table.source.file}: the run is said to be continuous, but there is no column t_s")
    return said == "continuous"


def _note_of_drive(table: RunTable, t: Array | None, q: Array) -> list[str]:
    """Say that a run which is logged now and then was taken for a drive, where the file does not say what it is."""
    if t is None or "measure" in table.notes or is_dense(t, q):
        return []
    return [
        Aside(
            f"{table.source.name}: a sample every {np.median(np.diff(t)):.2g} s, each farther along its way: taken for "
            "a drive, along which neighbours err alike ('# measure: static' above the columns makes them poses at rest)"
        )
    ]


def _sessions(table: RunTable, t: Array | None) -> tuple[IntArray, list[str]]:
    """Return the session of each sample, and a warning where the clock decided it."""
    given = table.optional_column("session")
    session, back = number_sessions(t, given, table.frame.height)
    if len(back) == 0:
        return read_only(session, np.int64), []
    # 0.75: of the rows, in any order but the reverse, at which a clock steps back: half of them by chance
    if len(back) >= FEWEST_ROWS and len(back) > 0.75 * (table.frame.height - 1):
        raise table.source.error(
            int(back[0]), "t", f"time runs backwards here and in {len(back) - 1} more of {table.frame.height} rows; "
            "put the rows into the order in which they were measured, or leave the column out"
        )  # fmt: skip
    lines = ", ".join(table.source.at(int(row)).rpartition(", ")[2] for row in back[:3])
    more = f" and {len(back) - 3} more" if len(back) > 3 else ""
    result = "a new session begins at each" if given is None else "within a session; its number was kept"
    times = f"{len(back)} time" + "s" * (len(back) > 1)
    warning = f"{table.source.name}: the clock steps back {times} ({lines}{more}): {result}"
    return read_only(session, np.int64), [warning]


def load_runs(paths: Sequence[Path], n_joints: int, axes_of: AxesOf | None = None) -> Run:
    """Load several files as one run; each begins a new session and, unless it names fixtures, a new placement.

    A file with readings but no angles is the gauge's own log and is joined with the one that has angles but no
    readings (see `planner.runs.synchronisation`). ``axes_of``: as of :func:`load_run`.

    Raises:
        InputError: a file is wrong, or they do not read the same kind of gauge.
    """
    if not paths:
        raise InputError("no run was given; name one or more files, .csv or .parquet")
    files = [Path(path) for path in paths]
    refuse_repeated_files(files)
    tables = [in_model_axes(read_table(file, n_joints), axes_of) for file in files]
    runs = [run_of(table, n_joints) for table in pair_tables(tables)]
    run = join_runs(_distinguish_names(runs, files))
    return replace(run, warnings=(*run.warnings, *repeated_row_notes(run)))


def _distinguish_names(runs: Sequence[Run], files: Sequence[Path]) -> list[Run]:
    """Return runs whose files have one name in different folders under the names of both, so that placements differ."""
    names = [run.name for run in runs]
    folders = {file.stem: [f.resolve().parent.name for f in files if f.stem == file.stem] for file in files}
    result = []
    for i, run in enumerate(runs):
        if names.count(run.name) > 1:
            folder = folders[run.name][names[:i].count(run.name)]
            places = (f"{folder}/{run.name}",) if run.places == (run.name,) else run.places
            own_files = tuple(f"{folder}/{file}" for file in run.files)
            run = replace(run, name=f"{folder}/{run.name}", places=places, files=own_files)
        result.append(run)
    return result


def join_runs(runs: Sequence[Run]) -> Run:
    """Return one run of all samples in the order given.

    Raises:
        InputError: the runs differ in kind of reading, in static or continuous, or in robot.
    """
    if len(runs) == 1:
        return runs[0]
    of_robot = [r for r in runs if r.robot is not None]
    _check_same([r.readings.columns for r in runs], runs, "reads {}")
    _check_same(["continuous" if r.continuous else "static" for r in runs], runs, "is {}", _hint_for_loaded_runs(runs))
    _check_same([r.robot or "" for r in of_robot], of_robot, "is of the robot {}")
    warnings = [w for r in runs for w in r.warnings]
    if runs[0].readings.position is not None:  # a tracker may have been set up anew between two files
        runs = [replace(r, places=(r.name,)) if r.places == ("",) else r for r in runs]
    places = tuple(dict.fromkeys(name for r in runs for name in r.places))
    balls, points = (sort_names({n for r in runs for n in getattr(r, key)}) for key in ("balls", "points"))
    names = [r.name for r in runs]
    samples = _concatenate(_renumbered_samples(runs, places, points, warnings), names, warnings)
    plans = {r.plan_id for r in runs}
    if len(plans) > 1:
        belonging = ", ".join(f"{r.name} to {r.plan_id or 'none'}" for r in runs)
        warnings.append(f"the files belong to different plans: {belonging}")
    readings = [
        r.readings if r.readings.ball is None else replace(r.readings, ball=_reindex(r.readings.ball, r.balls, balls))
        for r in runs
    ]
    joined = _concatenate(readings, names, warnings)
    if len({r.turns_as for r in runs}) > 1:  # each is turned as it says; no one convention can be tried
        joined = replace(joined, turns=None)
    return replace(
        runs[0],
        name="+".join(names),
        samples=samples,
        readings=joined,
        places=places,
        balls=balls,
        points=points,
        clocks=max(r.clocks for r in runs),
        plan_id=runs[0].plan_id if len(plans) == 1 else None,
        robot=of_robot[0].robot if of_robot else None,
        warnings=tuple(warnings),
        files=tuple(file for r in runs for file in r.files),
        simulated=any(r.simulated for r in runs),
    )


def _hint_for_loaded_runs(runs: Sequence[Run]) -> str:
    """What would help where circles under load were logged as they were driven, beside a run at rest."""
    raw = [r.name for r in runs if r.continuous and r.samples.force is not None]
    if not raw:
        return ""
    return advice(Occasion.LOADED_RUN, run=raw[0])


def _check_same(values: Sequence[str], runs: Sequence[Run], text: str, more: str = "") -> None:
    for value, run in zip(values, runs, strict=True):
        if value != values[0]:
            raise InputError(
                f"{run.name} {text.format(value)}, but {runs[0].name} {text.format(values[0])}; "
                f"only runs of one kind are joined{more}"
            )


def _renumbered_samples(
    runs: Sequence[Run], places: tuple[str, ...], points: tuple[str, ...], warnings: list[str]
) -> list[Samples]:
    """Return the samples of each run with sessions, files, places and points counted through all runs.

    Where some log the pull of the bar, the others have none.
    """
    lacking = [r.name for r in runs if r.samples.force is None]
    if 0 < len(lacking) < len(runs):
        warnings.append(f"force is not logged in {', '.join(lacking)}: taken as no pull of the bar")
    first_session = first_file = 0
    result = []
    for r in runs:
        s = r.samples
        session = s.session_numbers + first_session
        s = replace(s, session=session, place=_reindex(s.place, r.places, places))
        if len(points) > 1:
            s = replace(s, point=_reindex(s.point_numbers, r.points, points))
        if s.file is not None:
            s = replace(s, file=s.file + first_file)
        if s.force is None and len(lacking) < len(runs):
            s = replace(s, force=np.zeros(len(r)))
        result.append(s)
        first_session, first_file = int(session.max()) + 1, first_file + len(r.files)
    return result


def _concatenate(parts: Sequence[T], names: Sequence[str], warnings: list[str]) -> T:
    """Join what is logged in all files; warn of what is logged in some."""
    joined: dict[str, Any] = {}
    for name in (f.name for f in fields(parts[0])):
        values = [getattr(part, name) for part in parts]
        lacking = ", ".join(n for n, value in zip(names, values, strict=True) if value is None)
        if not lacking:
            values = pad_corners(values) if name in OF_CORNERS else values
        joined[name] = None if lacking else read_only(np.concatenate(values), values[0].dtype)
        if lacking and any(value is not None for value in values) and name not in UNNAMED:
            warnings.append(f"{name} is not logged in {lacking}, so it was left out of the other files too")
    return replace(parts[0], **joined)


def _reindex(index: IntArray, own: tuple[str, ...], common: tuple[str, ...]) -> IntArray:
    """Return indices into ``common`` of what ``index`` counts in ``own``."""
    return np.asarray(np.array([common.index(name) for name in own])[index])
