"""What every part of the study starts from: candidates, what they see, a selection of poses."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.candidates import PoseSet, draw_candidates
from planner.cell import Cell
from planner.choice import what_is_seen
from planner.errors import NoSolutionError
from planner.model import Model
from planner.observability import Covariance, Identifiability, covariance
from planner.selection import exchange
from planner.study.curves import Curve, index_curves, pick
from planner.units import Array

CANDIDATES = 5000  # enough for every finding of the study; the plan itself looks among more
Say = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Basis:
    """Candidates and chosen poses of the cell as it is.

    Attributes:
        cell, index, seed: what was asked; index one of O1 … O5.
        pool: candidates of all fixtures.
        whole: the model with all parameters that the cell frees; ``whole_rows`` (n, r, P) its Jacobian.
        model: the identifiable parameters only; ``rows`` (n, r, p) theirs; ``seen`` why the others are left out.
        curves: index against number of poses, for every index, raw and unit-free.
        poses: how many the plan would take; ``chosen`` (poses,) positions in the pool.
        predicted: covariance of the parameters after measuring the chosen poses once.
        noise: of a typical reading [m].
    """

    cell: Cell
    index: str
    seed: int
    pool: PoseSet
    whole: Model
    whole_rows: Array
    model: Model
    rows: Array
    seen: Identifiability
    curves: tuple[Curve, ...]
    poses: int
    chosen: np.ndarray
    predicted: Covariance
    noise: float


def basis(cell: Cell, index: str, seed: int, say: Say) -> Basis:
    """Draw candidates, find what they see, and choose as many poses as the cell asks for or the curve suggests.

    Raises:
        NoSolutionError: a filter leaves fewer candidates than there are parameters.
    """
    count = min(CANDIDATES, cell.plan.candidates)
    pool = draw_candidates(cell, count, seed, lambda done, of: say("candidates", done, of))
    say("what is seen", 0, 0)
    model, seen, rows = what_is_seen(cell, pool)
    if len(pool) < 3 * seen.rank:
        raise NoSolutionError(
            f"only {len(pool)} candidate poses are left for {seen.rank} parameters: "
            "widen the cones, the cable's budget or the clearance"
        )
    whole = Model.from_cell(cell)
    curves = index_curves(rows, model.prior, index, seed, say)
    poses = cell.plan.poses or pick(curves, index, scaled=False).knee
    chosen = exchange(rows, min(max(poses, seen.rank), len(pool)), index, starts=2, seed=seed, steps=300).chosen
    noise = model.noise(pool.q, pool.fixture)
    return Basis(
        cell=cell,
        index=index,
        seed=seed,
        pool=pool,
        whole=whole,
        whole_rows=whole.jacobian(pool.q, pool.fixture),
        model=model,
        rows=rows,
        seen=seen,
        curves=curves,
        poses=len(chosen),
        chosen=chosen,
        predicted=covariance(rows[chosen], noise[chosen, None]),
        noise=float(np.median(noise)),
    )
