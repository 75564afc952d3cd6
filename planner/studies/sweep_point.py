"""One point of a sweep: arms with random errors, identified from readings at chosen poses, linearised."""

from dataclasses import dataclass, fields
from zlib import crc32

import numpy as np
import polars as pl
from threadpoolctl import threadpool_limits

from planner import __version__
from planner.cell.cell import Cell
from planner.cell.reading import cell_of, load_cell
from planner.common.errors import InputError, PlannerError
from planner.common.object_hashes import object_hash
from planner.common.units import Array, to_mm
from planner.design.candidates.balls import draw_pose_candidates
from planner.design.free_parameters import UndeclaredErrors, undeclared_errors
from planner.design.pose_selection import identify_candidates
from planner.design.selection.index_search import exchange_poses
from planner.effects.catalogue import registrations
from planner.runs.run import Samples
from planner.studies.sweep_file import Changes, changed_file

ERRORS = ("nominal", "geometry", "posterior")
LABELS = frozenset({"name", "path", "file"})  # of a cell: where it was read from, and what its other fields say again
FILE_LABELS = frozenset({"robot", "packages", "prior"})  # of its file: where the robot was read from


def cell_hash(cell: Cell) -> str:
    """Return the SHA-256 of all that a cell says: robot, gauge, surroundings with their meshes, priors, own effects.

    Where its files lie does not count.
    """
    said = {f.name: getattr(cell, f.name) for f in fields(cell) if f.name not in LABELS}
    file = cell.file.model_dump(mode="json", by_alias=True, exclude=set(FILE_LABELS))
    own = [r.generator for r in registrations() if not r.generator.__module__.startswith("planner.")]
    return object_hash(said, file, own)


@dataclass(frozen=True)
class SweepTask:
    """One point.

    Attributes:
        cell: shipped, or a path; ``content``: the hash of all that it says.
        poses: how many are measured; ``trials``: arms; ``seed``: of both; ``candidates``: of poses.
        changes: what the cell file says otherwise, the index among it.
    """

    cell: str
    content: str
    poses: int
    trials: int
    seed: int
    candidates: int
    changes: Changes = ()

    @property
    def key(self) -> str:
        """Name of its part: a hash of what decides its numbers, the version among it."""
        decides = (self.content, self.poses, self.trials, self.seed, self.candidates, dict(self.changes))
        return object_hash(__version__, *decides)[:16]

    def load(self) -> Cell:
        """Return the cell.

        Raises:
            InputError: it contradicts itself with these values, or is not the cell of which the task was made.
        """
        base = load_cell(self.cell)
        if cell_hash(base) != self.content:
            raise StaleCellError(
                f"{self.cell}: its files (or those of its robot, or effects) are not those with which the sweep began: "
                "begin again with the same files everywhere"
            )
        return cell_of(changed_file(base.file, self.changes, self.candidates, self.cell), base.path, base.name)


class StaleCellError(InputError):
    """A worker reads another cell than the one that was asked for."""


@dataclass(frozen=True)
class TrialErrors:
    """Tool errors over the workspace, rms, of every trial: (m, 3) [m]: nominal, geometry alone, posterior.

    Where nothing can be measured there is one row of nan, and ``because`` says why.
    """

    errors: Array
    because: str = ""

    def table(self) -> pl.DataFrame:
        """Return one row a trial: ``trial``, ``nominal_mm``, ``geometry_mm``, ``posterior_mm``, ``because``."""
        numbers = {f"{name}_mm": to_mm(self.errors[:, k]) for k, name in enumerate(ERRORS)}
        count = len(self.errors)
        said = {"because": [self.because] * count}
        return pl.DataFrame({"trial": np.arange(count, dtype=np.int64), **numbers, **said})


def run_task(task: SweepTask) -> TrialErrors:
    """Return the errors of a point's trials. Deterministic.

    No data frame is made here: their threads do not live in a copy of a process.

    Raises:
        StaleCellError: the cell is not the one of which the task was made.
    """
    try:
        with threadpool_limits(1, user_api="blas"):
            return TrialErrors(_errors(task))
    except StaleCellError:
        raise
    except PlannerError as err:
        return TrialErrors(np.full((1, len(ERRORS)), np.nan), str(err))


def _errors(task: SweepTask) -> Array:
    cell = task.load()
    pool = draw_pose_candidates(cell, cell.plan.candidates, task.seed)
    rows = identify_candidates(cell, pool)[2]
    # 300: steps of annealing in the choice of poses
    chosen = exchange_poses(rows, task.poses, cell.plan.index, seed=task.seed, steps=300).chosen
    samples = pool.samples.take(chosen)
    found = undeclared_errors(cell, samples)
    white = _white_rows(found, samples)
    z = draw_arms(found.model.names, task.trials, task.seed)
    y = z @ white.T + _draw_noise(len(white), task.trials, task.seed)
    geometry = np.array([not p.is_effect for p in found.model.parameters])
    plain = np.zeros_like(z)
    plain[:, geometry] = _ridge(white[:, geometry], y)
    return np.stack([_tool_error(found, e) for e in (z, z - plain, z - _ridge(white, y))], axis=1)


def draw_arms(names: tuple[str, ...], trials: int, seed: int) -> Array:
    """Return errors in prior sigmas, (trials, P), each drawn by its name: a seed has the same arms at every point.

    The first arms of a longer sweep are those of a shorter one.
    """
    drawn = [np.random.default_rng([seed, crc32(name.encode())]).standard_normal(trials) for name in names]
    return np.stack(drawn, axis=1)


def _draw_noise(readings: int, trials: int, seed: int) -> Array:
    """Return noise in standard deviations, (trials, n): the same for the k-th reading at every point."""
    streams = (np.random.default_rng([seed, crc32(b"noise of readings"), k]) for k in range(readings))
    return np.stack([rng.standard_normal(trials) for rng in streams], axis=1)


def _white_rows(found: UndeclaredErrors, samples: Samples) -> Array:
    """Return the rows of readings in standard deviations per prior sigma, (n r, P), for a gauge of any width r."""
    noise = found.model.reading_noise(samples)
    rows = found.model.rows(samples)
    variance = np.broadcast_to(noise.gauge_variance, rows.shape[:2])
    root = np.linalg.cholesky(noise.robot_covariance + variance[:, :, None] * np.eye(rows.shape[1]))
    return np.asarray(np.linalg.solve(root, rows).reshape(-1, rows.shape[2]) * found.prior)


def _ridge(white: Array, y: Array) -> Array:
    """Return the posterior mean (m, P) of unit normal errors from white readings y (m, n)."""
    inner = white @ white.T + np.eye(len(white))
    return np.asarray(np.linalg.solve(inner, y.T).T @ white)


def _tool_error(found: UndeclaredErrors, errors: Array) -> Array:
    square = (errors @ found.weight_per_prior * errors).sum(axis=1)
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))
