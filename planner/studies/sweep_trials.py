"""One point of a sweep: poses in a cell, and how well arms drawn at random are identified from them.

Arms have errors in all that the cell frees, gears that err and joints that give way; readings are linear in them, and
so are both fits: of the geometry alone, and of everything with its sizes (the posterior mean). What is left moves the
tool over the workspace, a new alignment of the base apart.
"""

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import polars as pl
from threadpoolctl import threadpool_limits

from planner.cell.cell import Cell
from planner.cell.file import CellFile
from planner.cell.reading import cell_of, load_cell
from planner.common.errors import PlannerError
from planner.common.units import Array, to_mm
from planner.design.candidates.pool import draw_candidates
from planner.design.pose_selection import identify_candidates
from planner.design.selection.index_search import exchange_poses
from planner.design.undeclared_errors import UndeclaredErrors, undeclared_errors

Triple = tuple[float, float, float]
STEPS = 300  # of annealing in the choice of poses


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


def _errors(task: SweepTask) -> Array:
    """Error of the tool over the workspace, rms, of every trial (m, 3) [m]: nominal, geometry alone, posterior."""
    cell = task.load()
    pool = draw_candidates(cell, cell.plan.candidates, task.seed)
    rows = identify_candidates(cell, pool)[2]
    chosen = exchange_poses(rows, task.poses, cell.plan.index, seed=task.seed, steps=STEPS).chosen
    samples = pool.samples.take(chosen)
    found = undeclared_errors(cell, samples)
    white = found.white(samples)
    rng = np.random.default_rng(int(task.key, 16))
    z = rng.standard_normal((task.trials, white.shape[1]))
    y = z @ white.T + rng.standard_normal((task.trials, len(white)))
    geometry = np.array([p.group in ("gauge", "geometry") for p in found.model.parameters])
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
