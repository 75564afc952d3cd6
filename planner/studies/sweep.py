"""Sweeps: every combination of values of a cell's keys, the same arms at each point, here or on a cluster.

Finished parts are the truth: a sweep that was stopped goes on with what is missing, and gives the same numbers
whatever computes them. Parts are named by content (cell, robot, meshes, priors, options, version, seed), so that a cell
that was changed is computed anew, and one that was moved to another folder is not.
"""

import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import polars as pl

from planner.cell.reading import load_cell
from planner.common.choices import IndexName
from planner.common.cluster import connect, refuse_pickles
from planner.common.errors import InputError, MissingProgramError, PlannerError
from planner.common.files import document_text, write_together
from planner.common.notebook import shown_progress
from planner.common.progress import Progress
from planner.common.result import Result
from planner.common.schema import read_toml, validate
from planner.common.second_process import map_in_copies
from planner.common.summary import Summary
from planner.motion.planning_packages import require_planning_packages
from planner.studies.sweep_comparison import compare_neighbours
from planner.studies.sweep_file import SCHEMA, SweepFile, changed_file, column_value
from planner.studies.sweep_point import SweepTask, cell_hash, run_task

TIMEOUT = "20s"  # for the scheduler to answer


@dataclass(frozen=True)
class SweepResult(Result):
    """All trials of a sweep.

    Attributes:
        table: one row a trial: ``point``, ``cell``, ``poses``, a column for each axis, ``trial``, the tool's error over
            the workspace ``nominal_mm``, ``geometry_mm``, ``posterior_mm``, and ``because``.
        axes: names of the columns that tell the points apart.
        points: how many there are; ``known``: of how many the parts were there already.

    Example:
        >>> swept = sweep("SWEEP.toml", "out")  # doctest: +SKIP
        >>> swept.figures.select("poses", "posterior_mm", "posterior_se_mm")  # doctest: +SKIP
    """

    table: pl.DataFrame
    axes: tuple[str, ...]
    points: int
    known: int

    @cached_property
    def figures(self) -> pl.DataFrame:
        """One row a point: median and 95 % of the tool's error over the arms, best first.

        ``posterior_se_mm`` is the standard error of the median; ``next_…`` compare it with the next point, see
        :meth:`comparisons`.
        """
        return compare_neighbours(self.table, self.axes).figures

    @cached_property
    def comparisons(self) -> pl.DataFrame:
        """One row a pair of neighbours: along which axis (or ``rank``), difference, standard error, ``differs``.

        Differences are of the same arms; ``differs`` holds where it is not chance (5 % over all pairs, Holm).
        """
        return compare_neighbours(self.table, self.axes).pairs

    def overview(self) -> Summary:
        """Return the best points, and which of them chance could have ordered."""
        facts = []
        for row in self.figures.head(8).iter_rows(named=True):
            where = ", ".join(f"{k} {row[k]}" for k in self.axes if row[k] is not None)
            if row["posterior_mm"] is None:
                facts.append(("none", f"{where}: {row['because']}"))
                continue
            next_ = {True: "; better than the next", False: "; the next may be as good", None: ""}[row["next_differs"]]
            facts.append(
                (
                    f"{row['posterior_mm']:.3f} mm",
                    f"{where}; 95 % within {row['posterior_95_mm']:.3f}, geometry alone {row['geometry_mm']:.3f}, "
                    f"uncalibrated {row['nominal_mm']:.3f} mm{next_}",
                )
            )
        known = f"{self.points} points, {self.known} of them computed before"
        return Summary(f"{known}; tool error over the workspace, median of arms:", facts)

    def content(self) -> Mapping[str, Any]:
        """Return the figures of every point, and the comparisons of neighbours."""
        return {
            "schema": "edbb-sweep-result/2",
            "points": self.figures.to_dicts(),
            "comparisons": self.comparisons.to_dicts(),
        }

    def write(self, folder: Path | str, force: bool = False) -> list[Path]:
        """Write ``sweep.json``, ``sweep.csv`` and ``comparisons.csv`` beside the parts; older ones are its own."""
        folder = Path(folder)
        texts = {
            "sweep.json": document_text(self.content()),
            "sweep.csv": self.figures.write_csv(),
            "comparisons.csv": self.comparisons.write_csv(),
        }
        write_together([(folder / name, text.encode()) for name, text in texts.items()], own=True)
        return [folder / name for name in texts]

    def files(self, folder: Path) -> str:
        """Name what is written."""
        return "sweep.json, sweep.csv, comparisons.csv, parts/*.parquet"


def sweep(
    wanted: Path | str | Mapping[str, Any],
    folder: Path | str | None = None,
    *,
    seed: int | None = None,
    index: IndexName | None = None,
    scheduler: str | None = None,
    cluster_keys: Path | None = None,
    progress: Progress | None = None,
) -> SweepResult:
    """Compute the points of a sweep that are missing in ``folder``, and return all of it.

    Args:
        wanted: ``SWEEP.toml``, or its content; cells by path then count from where you are.
        folder: of the results; ``parts`` in it holds what is finished. Without it nothing is kept.
        seed: of arms and poses, in place of the file's.
        index: by which poses are chosen, in place of the file's or the cell's.
        scheduler: address of a Dask scheduler (``tls://…``); by default everything is computed here.
        cluster_keys: folder of the keys of its cluster.
        progress: called with the stage, how much of it is done, and of how much.

    Raises:
        InputError: the file is wrong, or an axis is no key of a cell's file.
        MissingProgramError: Dask is not installed, or nobody answers at the address.

    Example:
        >>> noise = {"cells": ["ur10/edbb"], "poses": [40], "trials": 50, "axes": {"gauge.noise_um": [2, 10, 50]}}
        >>> sweep(noise).figures  # doctest: +SKIP
    """
    require_planning_packages()
    where = "the sweep" if isinstance(wanted, Mapping) else str(wanted)
    file = (
        validate({"schema": SCHEMA, **wanted}, SweepFile, where)
        if isinstance(wanted, Mapping)
        else read_toml(Path(wanted), SweepFile)
    )
    said = {"seed": seed, "index": index}
    file = file.model_copy(update={k: v for k, v in said.items() if v is not None})
    file.check(where)
    beside = Path.cwd() if isinstance(wanted, Mapping) else Path(wanted).parent
    tasks, said_as = make_tasks(file, beside), dict(zip(file.named_cells(beside), file.cells, strict=True))
    with shown_progress(progress) as say:
        parts, known = _collect(tasks, None if folder is None else Path(folder) / "parts", scheduler, cluster_keys, say)
    labels = [{"point": k, "cell": said_as[task.cell], **_labels(task, file)} for k, task in enumerate(tasks)]
    whole = [
        part.select(*(pl.lit(value).alias(key) for key, value in label.items()), pl.all())
        for part, label in zip(parts, labels, strict=True)
    ]
    return SweepResult(pl.concat(whole, how="vertical_relaxed"), tuple(labels[0])[1:], len(tasks), known)


def make_tasks(file: SweepFile, folder: Path) -> list[SweepTask]:
    """Return the points of a sweep in order; all that their cells say is checked against the schema.

    Raises:
        InputError: a cell is none, its gauge is not at poses, or a change does not fit.
    """
    index = () if file.index is None else (("plan.index", file.index),)
    cells = {name: load_cell(name) for name in file.named_cells(folder)}
    for cell in cells.values():
        if cell.is_under_load:
            raise InputError(
                f"{cell.path}: a sweep is of gauges that measure at poses, and this cell drives something else"
            )
    hashes = {name: cell_hash(cell) for name, cell in cells.items()}
    tasks = [
        SweepTask(name, hashes[name], poses, file.trials, file.seed, file.candidates, (*changes, *index))
        for name, poses, changes in file.points(list(cells))
    ]
    for task in tasks:
        _ = changed_file(cells[task.cell].file, task.changes, task.candidates, task.cell)
    return tasks


def _labels(task: SweepTask, file: SweepFile) -> dict[str, object]:
    values = {key: column_value(value) for key, value in task.changes if key in file.all_axes}
    return {"poses": task.poses, **values}


def _collect(
    tasks: Sequence[SweepTask], parts: Path | None, scheduler: str | None, keys: Path | None, say: Progress
) -> tuple[list[pl.DataFrame], int]:
    """Return the tables of all tasks, those that are missing computed and kept, and how many were there."""
    found: dict[str, pl.DataFrame] = {}
    if parts is not None:
        parts.mkdir(parents=True, exist_ok=True)
        found = {t.key: table for t in tasks if (table := _read_part(parts / f"{t.key}.parquet")) is not None}
    known = sum(t.key in found for t in tasks)
    missing = list({t.key: t for t in tasks if t.key not in found}.values())
    say("points", known, len(tasks))
    for task, table in compute(missing, scheduler, keys):
        if parts is not None:
            write_part(task, table, parts)
        found[task.key] = table
        say("points", sum(t.key in found for t in tasks), len(tasks))
    return [found[t.key] for t in tasks], known


def write_part(task: SweepTask, table: pl.DataFrame, folder: Path) -> None:
    """Write a finished part, whole or not at all."""
    draft = folder / f".{task.key}.draft"
    table.write_parquet(draft)
    draft.replace(folder / f"{task.key}.parquet")


def _read_part(path: Path) -> pl.DataFrame | None:
    """Return a part; ``None`` where there is none, or a machine died while it wrote."""
    try:
        return pl.read_parquet(path)
    except (OSError, pl.exceptions.PolarsError):
        return None


def run_task_there(task: SweepTask) -> bytes | str:
    """Return the table of a task, or why there is none, as data: what came from another machine is read, not run."""
    out = io.BytesIO()
    try:
        run_task(task).table().write_ipc(out)
    except PlannerError as err:
        return str(err)
    return out.getvalue()


def read_table(data: object) -> pl.DataFrame:
    """Return the table that a worker has sent.

    Raises:
        InputError: it is none, or the sentence that says why there is none.
    """
    if isinstance(data, str):
        raise InputError(f"a worker: {data}")
    if not isinstance(data, bytes):
        raise InputError(f"a worker sent no table ({data}); is the same version installed there?")
    return pl.read_ipc(io.BytesIO(data))


def compute(
    tasks: Sequence[SweepTask], scheduler: str | None, keys: Path | None = None
) -> Iterator[tuple[SweepTask, pl.DataFrame]]:
    """Yield tasks with their tables as they are finished; from a cluster this process reads data alone, no pickle.

    Raises:
        InputError: a worker has other files than this process, or sends no table.
        MissingProgramError: Dask is not installed, or nobody answers at the address.
    """
    if scheduler is None or not tasks:
        for task, found in zip(tasks, map_in_copies(run_task, tasks), strict=True):
            yield task, found.table()
        return
    try:
        from distributed import Scheduler, as_completed
    except ImportError as err:
        raise MissingProgramError("--scheduler needs Dask: pip install 'edbb-planner[cluster]' installs it") from err
    with ExitStack() as stack:
        if not list(Scheduler._instances):  # a scheduler of this process could not read its own tasks
            stack.callback(refuse_pickles())
        client = stack.enter_context(connect(scheduler, keys, "--scheduler", TIMEOUT, "edbb-study"))
        # 3: times, if a task's worker dies
        futures = {client.submit(run_task_there, t, key=f"edbb-{t.key}", retries=3): t for t in tasks}
        for future in as_completed(futures, loop=client.loop):  # type: ignore[no-untyped-call]
            task = futures.pop(future)  # forgotten there and here: a sweep may be long
            try:
                yield task, read_table(future.result())
            except InputError:
                raise
            except Exception as err:
                raise InputError(f"{task.cell}: a worker failed ({err})") from err
