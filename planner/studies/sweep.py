"""Sweeps: fixtures × bars × tools × numbers of poses × cells, arms drawn at random at each point, here or on a cluster.

Finished parts are the truth: a sweep that was stopped goes on with what is missing, and gives the same numbers
whatever computes them.
"""

import hashlib
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import polars as pl
from pydantic import Field
from threadpoolctl import threadpool_limits

from planner.cell.cell import Cell
from planner.cell.file import CellFile
from planner.cell.reading import cell_of, load_cell
from planner.common.cluster import connect
from planner.common.errors import InputError, MissingProgramError, PlannerError
from planner.common.files import INPUTS, document_text, write_together
from planner.common.progress import Progress, no_progress
from planner.common.result import Result
from planner.common.schema import StrictModel, read_toml
from planner.common.summary import Summary
from planner.common.units import Array, to_mm
from planner.design.candidates.pool import draw_candidates
from planner.design.free_parameters import UndeclaredErrors, undeclared_errors
from planner.design.pose_selection import identify_candidates
from planner.design.selection.index_search import exchange_poses
from planner.kinematics.bodies import Vector

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class SweepTask:
    """One point: a cell with other places and sizes, ``None`` where they stay, and the trials in it."""

    cell: str
    poses: int
    trials: int
    seed: int
    candidates: int
    fixture_mm: Triple | None = None
    bar_mm: tuple[float, float] | None = None
    tool_mm: Triple | None = None

    @property
    def key(self) -> str:
        """Name of its part: a hash of what decides its numbers."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()[:16]

    def load(self) -> Cell:
        """Return the cell.

        Raises:
            InputError: it contradicts itself with these values.
        """
        base = load_cell(self.cell)
        file: CellFile = base.file
        gauge: dict[str, object] = {"mount_deg": None}
        plan = {"candidates": self.candidates}
        if self.bar_mm is not None:
            gauge |= {"length_mm": self.bar_mm}
        fixture: dict[str, object] = {"mount_deg": None} | (
            {} if self.fixture_mm is None else {"position_mm": self.fixture_mm}
        )
        changed = {
            "gauge": file.gauge.model_copy(update=gauge),
            "plan": file.plan.model_copy(update=plan),
            "fixtures": (file.fixtures[0].model_copy(update=fixture), *file.fixtures[1:]),
        }
        if self.tool_mm is not None and file.tool is not None:
            changed["tool"] = file.tool.model_copy(update={"map_mm": self.tool_mm})
        return cell_of(file.model_copy(update=changed), base.path, base.name)


def run_task(task: SweepTask) -> pl.DataFrame:
    """Return one row a trial; where nothing can be measured, one row that says why. Deterministic."""
    try:
        with threadpool_limits(1, user_api="blas"):
            errors, said = _errors(task), ""
    except PlannerError as err:
        errors, said = np.full((1, 3), np.nan), str(err)
    n = len(errors)
    place = {"fixture": task.fixture_mm, "tool": task.tool_mm}
    columns: dict[str, object] = {"cell": [task.cell] * n, "poses": [task.poses] * n}
    columns |= {f"{k}_{a}_mm": [None if v is None else v[i]] * n for k, v in place.items() for i, a in enumerate("xyz")}
    columns |= {
        f"bar_{e}_mm": [None if task.bar_mm is None else task.bar_mm[i]] * n for i, e in enumerate(("min", "max"))
    }
    columns |= {"trial": np.arange(n, dtype=np.int64)}
    columns |= {f"{name}_mm": to_mm(errors[:, k]) for k, name in enumerate(("nominal", "geometry", "posterior"))}
    numbers = [c for c in columns if c.endswith("_mm")]
    return pl.DataFrame(columns | {"because": [said] * n}).with_columns(pl.col(numbers).cast(pl.Float64))


def run_task_there(task: SweepTask) -> bytes:
    """Return the table of a task as data: what came from another machine is read, and not run."""
    out = io.BytesIO()
    run_task(task).write_ipc(out)
    return out.getvalue()


def read_table(data: object) -> pl.DataFrame:
    """Return the table that a worker has sent.

    Raises:
        InputError: it is none.
    """
    if not isinstance(data, bytes):
        raise InputError(f"a worker sent no table ({data}); is the same version installed there?")
    return pl.read_ipc(io.BytesIO(data))


def _errors(task: SweepTask) -> Array:
    """Error of the tool over the workspace, rms, of every trial (m, 3) [m]: nominal, geometry alone, posterior."""
    cell = task.load()
    pool = draw_candidates(cell, cell.plan.candidates, task.seed)
    rows = identify_candidates(cell, pool)[2]
    # 300: steps of annealing in the choice of poses
    chosen = exchange_poses(rows, task.poses, cell.plan.index, seed=task.seed, steps=300).chosen
    samples = pool.samples.take(chosen)
    found = undeclared_errors(cell, samples)
    white = found.white(samples)
    rng = np.random.default_rng(int(task.key, 16))
    z = rng.standard_normal((task.trials, white.shape[1]))
    y = z @ white.T + rng.standard_normal((task.trials, len(white)))
    geometry = np.array([not p.is_effect for p in found.model.parameters])
    plain = np.zeros_like(z)
    plain[:, geometry] = _ridge(white[:, geometry], y)
    return np.stack([_tool_error(found, e) for e in (z, z - plain, z - _ridge(white, y))], axis=1)


def _ridge(white: Array, y: Array) -> Array:
    """Return the posterior mean (m, P) of unit normal errors from white readings y (m, n)."""
    inner = white @ white.T + np.eye(len(white))
    return np.asarray(np.linalg.solve(inner, y.T).T @ white)


def _tool_error(found: UndeclaredErrors, errors: Array) -> Array:
    square = np.einsum("mp,pq,mq->m", errors, found.weight_per_prior, errors)
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))


def write_part(task: SweepTask, table: pl.DataFrame, folder: Path) -> None:
    """Write a finished part, whole or not at all."""
    draft = folder / f".{task.key}.draft"
    table.write_parquet(draft)
    draft.replace(folder / f"{task.key}.parquet")


TIMEOUT = "20s"  # for the scheduler to answer
PLACE = [f"{what}_{axis}_mm" for what in ("fixture", "tool") for axis in "xyz"]
POINT = ["cell", "poses", *PLACE, "bar_min_mm", "bar_max_mm"]


class SweepFile(StrictModel):
    """``SWEEP.toml``: every combination is a point; what is left out stays as the cell has it."""

    schema_: Literal["edbb-sweep/1"] = Field(alias="schema")
    cells: Annotated[tuple[str, ...], Field(min_length=1)]
    poses: Annotated[tuple[Annotated[int, Field(ge=4, le=1000)], ...], Field(min_length=1)]
    fixtures_mm: tuple[Vector, ...] = ()
    bars_mm: tuple[tuple[float, float], ...] = ()
    tools_mm: tuple[Vector, ...] = ()
    trials: Annotated[int, Field(ge=1, le=100_000)] = 200
    candidates: Annotated[int, Field(ge=100, le=100_000)] = 800
    seed: Annotated[int, Field(ge=0)] = 0

    def tasks(self, folder: Path) -> list[SweepTask]:
        """Return the points in order; cells are shipped ones, or paths from ``folder``."""
        paths = [(folder / c).resolve() for c in self.cells]
        there = [INPUTS.allows(p) and p.is_file() for p in paths]
        cells = [str(p) if is_file else c for c, p, is_file in zip(self.cells, paths, there, strict=True)]
        each = product(cells, self.poses, self.fixtures_mm or [None], self.bars_mm or [None], self.tools_mm or [None])
        return [SweepTask(c, n, self.trials, self.seed, self.candidates, f, b, t) for c, n, f, b, t in each]


@dataclass(frozen=True)
class SweepResult(Result):
    """All trials of a sweep, one row each, and how many parts were there already."""

    table: pl.DataFrame
    points: int
    known: int

    @property
    def figures(self) -> pl.DataFrame:
        """One row a point: median and 95 % of the tool's error, best first."""
        value = pl.col("posterior_mm")
        figures = [
            pl.col("nominal_mm").median(), pl.col("geometry_mm").median(), value.median().alias("posterior_mm"),
            value.quantile(0.95).alias("posterior_95_mm"), pl.col("because").first(),
        ]  # fmt: skip
        grouped = self.table.group_by(POINT, maintain_order=True).agg(figures)
        return grouped.with_columns(pl.col(pl.Float64).fill_nan(None)).sort(
            "posterior_mm", nulls_last=True, maintain_order=True
        )

    def overview(self) -> Summary:
        """Return the best points."""
        facts = []
        for row in self.figures.head(8).iter_rows(named=True):
            where = ", ".join(f"{k} {v}" for k, v in row.items() if k in POINT and v is not None)
            if row["posterior_mm"] is None:
                facts.append(("none", f"{where}: {row['because']}"))
                continue
            facts.append(
                (
                    f"{row['posterior_mm']:.3f} mm",
                    f"{where}; 95 % within {row['posterior_95_mm']:.3f}, geometry alone {row['geometry_mm']:.3f}, "
                    f"uncalibrated {row['nominal_mm']:.3f} mm",
                )
            )
        known = f"{self.points} points, {self.known} of them computed before"
        return Summary(f"{known}; tool error over the workspace, median of arms:", facts)

    def content(self) -> Mapping[str, Any]:
        """Return the figures of every point."""
        return {"schema": "edbb-sweep-result/1", "points": self.figures.to_dicts()}

    def write(self, folder: Path | str, force: bool = False) -> list[Path]:
        """Write ``sweep.json`` and ``sweep.csv`` beside the parts, which stay; older ones are the sweep's own."""
        folder = Path(folder)
        texts = {"sweep.json": document_text(self.content()), "sweep.csv": self.figures.write_csv()}
        write_together([(folder / name, text.encode()) for name, text in texts.items()], own=True)
        return [folder / name for name in texts]

    def files(self, folder: Path) -> str:
        """Name what is written."""
        return "sweep.json, sweep.csv, parts/*.parquet"


def sweep(
    file: Path | str,
    folder: Path | str,
    *,
    scheduler: str | None = None,
    cluster_keys: Path | None = None,
    progress: Progress = no_progress,
) -> SweepResult:
    """Compute the parts of a sweep that are missing in ``folder``, and return all of it.

    Args:
        file: ``SWEEP.toml``.
        folder: of the results; ``parts`` in it holds what is finished.
        scheduler: address of a Dask scheduler (``tls://…``); by default everything is computed here.
        cluster_keys: folder of the keys of its cluster.
        progress: called with the stage, how much of it is done, and of how much.

    Raises:
        InputError: the file is wrong.
        MissingProgramError: Dask is not installed, or nobody answers at the address.
    """
    wanted = read_toml(Path(file), SweepFile)
    tasks = wanted.tasks(Path(file).parent)
    for cell in {t.cell for t in tasks}:
        load_cell(cell).require_bar(f"{file}, 'cells': a sweep is of bars and their fixtures")
    parts = Path(folder) / "parts"
    parts.mkdir(parents=True, exist_ok=True)
    missing = [t for t in tasks if not _is_whole(parts / f"{t.key}.parquet")]
    done = len(tasks) - len(missing)
    for task, table in compute(missing, scheduler, cluster_keys):
        write_part(task, table, parts)
        done += 1
        progress("points", done, len(tasks))
    return SweepResult(
        pl.concat([pl.read_parquet(parts / f"{t.key}.parquet") for t in tasks]), len(tasks), len(tasks) - len(missing)
    )


def _is_whole(path: Path) -> bool:
    try:
        return pl.read_parquet_schema(path) != {}
    except (OSError, pl.exceptions.PolarsError):
        return False


def compute(
    tasks: Sequence[SweepTask], scheduler: str | None, keys: Path | None = None
) -> Iterator[tuple[SweepTask, pl.DataFrame]]:
    """Yield tasks with their tables as they are finished.

    Raises:
        MissingProgramError: Dask is not installed, or nobody answers at the address.
    """
    if scheduler is None or not tasks:
        for task in tasks:
            yield task, run_task(task)
        return
    try:
        from distributed import as_completed
    except ImportError as err:
        raise MissingProgramError("--scheduler needs Dask: pip install 'edbb-planner[cluster]' installs it") from err
    with ExitStack() as stack:
        client = stack.enter_context(connect(scheduler, keys, "--scheduler", TIMEOUT, "edbb-study"))
        # 3: times, if a task's worker dies
        futures = {client.submit(run_task_there, t, key=f"edbb-{t.key}", retries=3): t for t in tasks}
        for future in as_completed(futures):  # type: ignore[no-untyped-call]
            yield futures.pop(future), read_table(future.result())  # forgotten there and here: a sweep may be long
