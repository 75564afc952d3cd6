"""Several runs made one: sessions numbered through, places and names brought together."""

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.run.loading import run_of
from planner.run.pairing import paired
from planner.run.reading import kind_of, sorted_names
from planner.run.table import read_table
from planner.run.types import IntArray, Readings, Run, Samples
from planner.units import Array


def load_runs(paths: Sequence[Path], n_joints: int) -> Run:
    """Load several files as one run; each begins a new session and, unless it names fixtures, a new placement.

    A file with readings but no angles is the gauge's own log and is joined with the one that has angles but no
    readings (see `planner.run.synchronise`).

    Raises:
        InputError: a file is wrong, or they do not read the same kind of gauge.
    """
    if not paths:
        raise InputError("no run was given; name one or more files, .csv or .parquet")
    files = [Path(path) for path in paths]
    for i, file in enumerate(files):
        if file.resolve() in (other.resolve() for other in files[:i]):
            raise InputError(f"{file} is given twice; the same samples would count as new ones")
    runs = [run_of(table, n_joints) for table in paired([read_table(file, n_joints) for file in files])]
    return joined(_apart(runs, files))


def _apart(runs: Sequence[Run], files: Sequence[Path]) -> list[Run]:
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


def joined(runs: Sequence[Run]) -> Run:
    """Return one run of all samples in the order given.

    Raises:
        InputError: the runs differ in kind of reading, in static or continuous, or in robot.
    """
    if len(runs) == 1:
        return runs[0]
    _same([kind_of(r.readings) for r in runs], runs, "reads {}")
    _same(["continuous" if r.continuous else "static" for r in runs], runs, "is {}", _averaged(runs))
    _same(
        [r.robot for r in runs if r.robot is not None], [r for r in runs if r.robot is not None], "is of the robot {}"
    )
    warnings = [w for r in runs for w in r.warnings]
    if runs[0].readings.position is not None:  # a tracker may have been set up anew between two files
        runs = [replace(r, places=(r.name,)) if r.places == ("",) else r for r in runs]
    places = tuple(dict.fromkeys(name for r in runs for name in r.places))
    balls, points = (sorted_names({n for r in runs for n in getattr(r, key)}) for key in ("balls", "points"))
    samples = _samples(runs, places, points, warnings)
    plans = {r.plan_id for r in runs}
    if len(plans) > 1:
        warnings.append(
            "the files belong to different plans: " + ", ".join(f"{r.name} to {r.plan_id or 'none'}" for r in runs)
        )
    return Run(
        "+".join(r.name for r in runs),
        samples,
        _readings(runs, balls, warnings),
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


def _averaged(runs: Sequence[Run]) -> str:
    """What would help where circles under load were logged as they were driven, beside a run at rest."""
    raw = [r.name for r in runs if r.continuous and r.samples.force is not None]
    if not raw:
        return ""
    return f"; edbb loaded brings {raw[0]} into a static run, averaged.csv, or fits both at once (--with)"


def _same(values: Sequence[str], runs: Sequence[Run], text: str, more: str = "") -> None:
    for value, run in zip(values, runs, strict=True):
        if value != values[0]:
            raise InputError(
                f"{run.name} {text.format(value)}, but {runs[0].name} {text.format(values[0])}; "
                f"only runs of one kind are joined{more}"
            )


def _samples(runs: Sequence[Run], places: tuple[str, ...], points: tuple[str, ...], warnings: list[str]) -> Samples:
    """Join what is logged in all files; warn of what is logged in some."""
    parts: dict[str, Array | IntArray | None] = {}
    runs = _without_load(runs, warnings)
    for name in (f.name for f in fields(Samples)):
        parts[name] = _all_or_none(name, runs, [getattr(r.samples, name) for r in runs], warnings)
    if parts["file"] is not None:
        first = np.cumsum([0, *(len(r.files) for r in runs[:-1])])
        parts["file"] = _locked(parts["file"] + np.repeat(first, [len(r) for r in runs]))
    parts["place"] = _renamed([r.samples.place for r in runs], [r.places for r in runs], places)
    if len(points) > 1:
        zeros = [r.samples.point if r.samples.point is not None else np.zeros(len(r), dtype=np.int64) for r in runs]
        parts["point"] = _renamed(zeros, [r.points for r in runs], points)
    offset, numbered = 0, []
    for r in runs:
        session = r.samples.session if r.samples.session is not None else np.zeros(len(r), dtype=np.int64)
        numbered.append(session + offset)
        offset = int(numbered[-1].max()) + 1
    parts["session"] = _locked(np.concatenate(numbered))
    return Samples(**parts)  # type: ignore[arg-type]


def _without_load(runs: Sequence[Run], warnings: list[str]) -> list[Run]:
    """Return the runs with no pull of the bar where none was logged but others log one."""
    lacking = [r.name for r in runs if r.samples.force is None]
    if not 0 < len(lacking) < len(runs):
        return list(runs)
    warnings.append(f"force is not logged in {', '.join(lacking)}: taken as no pull of the bar")
    return [
        replace(r, samples=replace(r.samples, force=_locked(np.zeros(len(r))))) if r.samples.force is None else r
        for r in runs
    ]


def _readings(runs: Sequence[Run], balls: tuple[str, ...], warnings: list[str]) -> Readings:
    parts = {
        f.name: _all_or_none(f.name, runs, [getattr(r.readings, f.name) for r in runs], warnings)
        for f in fields(Readings)
    }
    if balls:
        parts["ball"] = _renamed(
            [r.readings.ball for r in runs if r.readings.ball is not None], [r.balls for r in runs], balls
        )
    return Readings(**parts)


def _all_or_none(name: str, runs: Sequence[Run], values: Sequence[Array | None], warnings: list[str]) -> Array | None:
    there = [v for v in values if v is not None]
    if len(there) == len(values):
        return _locked(np.concatenate(there))
    if there and name not in ("session", "point", "file", "line"):
        lacking = ", ".join(r.name for r, v in zip(runs, values, strict=True) if v is None)
        warnings.append(f"{name} is not logged in {lacking}, so it was left out of the other files too")
    return None


def _renamed(parts: Sequence[IntArray], names: Sequence[tuple[str, ...]], common: tuple[str, ...]) -> IntArray:
    """Return indices into ``common`` of what each part counts in its own names."""
    return _locked(
        np.concatenate([np.array([common.index(n) for n in own])[p] for p, own in zip(parts, names, strict=True)])
    )


def _locked(array: Array) -> Array:
    array.setflags(write=False)
    return array
