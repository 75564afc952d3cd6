"""Which poses: what can be seen, how many poses it takes, the selection, its certificate and the refinement."""

from dataclasses import dataclass, replace

import numpy as np

from planner.candidates import PoseSet
from planner.cell import Cell
from planner.collision import CollisionWorld
from planner.errors import InputError, NoSolutionError
from planner.model import Model
from planner.observability import Identifiability, Indices, identifiable, index_value, indices
from planner.selection import Certificate, CurveInBackground, bound, exchange, refine
from planner.units import Array
from planner.workspace import ROOM, Workspace

ENOUGH = 2  # candidates for each parameter, below which there is no choice
CURVE_SIZES = (22, 24, 26, 28, 30, 35, 40, 50, 60, 80, 100, 140, 200)


@dataclass(frozen=True)
class Choice:
    """The poses that a plan measures, and why.

    Attributes:
        model: the measurement model with the identifiable parameters only.
        seen: what the candidates can see, and why the rest is dropped.
        q: chosen controller angles, refined off the grid where asked, (n, N) [rad].
        fixture: which fixture holds the bar, (n,) int.
        chosen: positions of the on-grid selection in the pool, (n,) int.
        index: name of the index.
        value: index of ``q``; ``on_grid_value`` that of the chosen candidates.
        certificate: no set of as many candidates beats its value.
        raw, scaled: O1 … O5 in metres and radians, and unit-free by the parameters' prior sizes.
    """

    model: Model
    seen: Identifiability
    q: Array
    fixture: np.ndarray
    chosen: np.ndarray
    index: str
    value: float
    on_grid_value: float
    certificate: Certificate
    raw: Indices
    scaled: Indices

    def with_poses(self, q: Array, chosen: np.ndarray, pool: PoseSet) -> "Choice":
        """Return the choice with other poses q (n, N) [rad] and candidates; the certificate holds for any of them."""
        grid = index_value(self.index, self.model.jacobian(pool.q[chosen], self.fixture))
        return replace(self.moved(q), chosen=chosen, on_grid_value=grid)

    def moved(self, q: Array) -> "Choice":
        """Return the choice with its poses moved off the grid to q (n, N) [rad], the indices computed anew."""
        rows = self.model.jacobian(q, self.fixture)
        value = index_value(self.index, rows)
        raw, scaled = indices(rows), indices(rows, self.model.prior)
        return replace(self, q=q, value=value, raw=raw, scaled=scaled)


def what_is_seen(cell: Cell, pool: PoseSet) -> tuple[Model, Identifiability, Array]:
    """Return the model of the identifiable parameters, why the others are dropped, and the rows of the pool.

    Raises:
        NoSolutionError: too few candidates to tell.
    """
    model = Model.from_cell(cell)
    if len(pool) < ENOUGH * len(model.names):
        raise NoSolutionError(
            f"only {len(pool)} candidate poses are left, too few to choose from for {len(model.names)} parameters: "
            "widen the cones, the cable's budget or the clearance, or raise plan.candidates"
        )
    rows = model.jacobian(pool.q, pool.fixture)
    noise = float(np.median(model.noise(pool.q[:1000], pool.fixture[:1000])))
    seen = identifiable(rows, model.names, model.prior, prefer=range(len(model.names)), noise=noise)
    return model.subset(list(seen.kept)), seen, np.ascontiguousarray(rows[:, :, list(seen.kept)])


def choose(cell: Cell, pool: PoseSet, poses: int | None, index: str, seed: int) -> tuple[Choice, CurveInBackground]:
    """Choose the poses; ``poses`` ``None`` takes the number where the curve of the index bends.

    Returns:
        The choice, and the curve, which is still being computed on the other processor.

    Raises:
        InputError: fewer poses than parameters.
        NoSolutionError: fewer candidates than poses.
    """
    model, seen, rows = what_is_seen(cell, pool)
    _check_count(poses, seen.rank, len(pool))
    sizes = [n for n in sorted({*CURVE_SIZES, *([poses] if poses else [])}) if seen.rank < n <= len(pool)]
    with CurveInBackground(rows, sizes, index, seed, help_out=poses is None) as curve:
        n = poses or curve.result().knee
        certificate = bound(rows, index, poses=n)
        selection = exchange(rows, n, index, seed=seed, certificate=certificate)
        q, fixture = pool.q[selection.chosen], pool.fixture[selection.chosen]
        final = model.jacobian(q, fixture)
        value, raw, scaled = index_value(index, final), indices(final), indices(final, model.prior)
    choice = Choice(model, seen, q, fixture, selection.chosen, index, value, selection.value, certificate, raw, scaled)
    return choice, curve


def refined(cell: Cell, choice: Choice, seed: int) -> Choice:
    """Move the chosen poses continuously to better the index, keeping every filter (one fixture at a time only)."""
    if not cell.plan.refine or len(cell.fixtures) > 1:
        return choice
    workspace, world = Workspace(cell), CollisionWorld.from_cell(cell)

    def valid(states: Array) -> np.ndarray:
        ok = np.asarray((workspace.margins(states) > ROOM).all(axis=1))
        ok[ok] = ~world.collides(states[ok], cell.motion.clearance + ROOM)
        return ok

    return choice.moved(refine(choice.q, choice.model.jacobian, valid, choice.index, seed=seed).q)


def _check_count(poses: int | None, parameters: int, candidates: int) -> None:
    if poses is not None and poses < parameters:
        raise InputError(
            f"{poses} poses cannot identify {parameters} parameters: ask for at least {parameters}, better "
            f"{int(1.5 * parameters)}, or free fewer in [plan]"
        )
    if candidates < (poses or parameters):
        raise NoSolutionError(
            f"only {candidates} candidate poses are left, fewer than the {poses or parameters} wanted: "
            "widen the cones, the cable's budget or the clearance, or raise plan.candidates"
        )
