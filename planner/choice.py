"""Which poses: what can be seen, how many poses it takes, the selection, its certificate and the refinement."""

from dataclasses import dataclass, replace

import numpy as np

from planner.candidates import PoseSet
from planner.cell import Cell
from planner.collision import CollisionWorld
from planner.errors import InputError, NoSolutionError
from planner.freed import held, planned_model, preference, unloaded, with_others
from planner.model import Model
from planner.observability import Identifiability, Indices, identifiable, index_value, indices
from planner.selection import Certificate, CurveInBackground, Share, bound, detmax, exchange, refine
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
        fixture: which of the cell's fixtures holds the bar (one entry for each tool point), (n,) int.
        chosen: positions of the on-grid selection in the pool, (n,) int.
        index: name of the index.
        value: index of ``q``; ``on_grid_value`` that of the chosen candidates.
        certificate: no set of as many candidates beats its value.
        raw, scaled: O1 … O5 in metres and radians, and unit-free by the parameters' prior sizes.
        ball: at which ball, (n,) int, where an artifact's balls are measured.
        approach: wanted sign of each axis' last movement before each pose, (n, N), 0 where any will do.
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
    ball: np.ndarray | None = None
    approach: np.ndarray | None = None

    def with_poses(self, q: Array, chosen: np.ndarray, pool: PoseSet) -> "Choice":
        """Return the choice with other poses q (n, N) [rad] and candidates; the certificate holds for any of them."""
        grid = index_value(self.index, self.model.jacobian(pool.q[chosen], self.fixture))
        ball = None if pool.ball is None else pool.ball[chosen]
        return replace(self.moved(q), chosen=chosen, on_grid_value=grid, ball=ball)

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
    model = planned_model(cell, pool.q, pool.fixture)
    if len(pool) < ENOUGH * len(model.names):
        raise NoSolutionError(
            f"only {len(pool)} candidate poses are left, too few to choose from for {len(model.names)} parameters: "
            "widen the cones, the cable's budget or the clearance, or raise plan.candidates"
        )
    rows = model.jacobian(pool.q, pool.fixture)
    noise = float(np.median(model.noise(pool.q[:1000], pool.fixture[:1000])))
    out = held(cell, model, rows, noise)
    names, free = model.names, [k for k, name in enumerate(model.names) if name not in {d.name for d in out}]
    if out:
        model, rows = model.subset(free), rows[:, :, free]
    seen = identifiable(rows, model.names, model.prior, prefer=preference(model), noise=noise)
    kept = list(seen.kept)
    seen = with_others(seen, names, (*out, *unloaded(cell.plan.effects, model)))
    return model.subset(kept), seen, np.ascontiguousarray(rows[:, :, kept])


def choose(cell: Cell, pool: PoseSet, poses: int | None, index: str, seed: int) -> tuple[Choice, CurveInBackground]:
    """Choose the poses; ``poses`` ``None`` takes the number where the curve of the index bends.

    Returns:
        The choice, and the curve, which is still being computed on the other processor.

    Raises:
        InputError: fewer poses than parameters.
        NoSolutionError: fewer candidates than poses.
    """
    model, seen, rows = what_is_seen(cell, pool)
    least = -(-seen.rank // model.width)
    _check_count(poses, least, len(pool), seen.rank)
    if pool.ball is not None and poses is not None:
        _ = Share.of(pool.ball, poses)  # told before the bound is sought
    sizes = [n for n in sorted({*CURVE_SIZES, *([poses] if poses else [])}) if least < n <= len(pool)]
    with CurveInBackground(rows, sizes, index, seed, help_out=poses is None) as curve:
        n = poses or curve.result().knee
        certificate = bound(rows, index, poses=n)
        chosen = _selected(rows, n, index, seed, certificate, pool)
        choice = _choice(model, seen, rows, pool, chosen, certificate)
    return choice, curve


def taken(cell: Cell, pool: PoseSet, chosen: np.ndarray, index: str, seed: int) -> tuple[Choice, CurveInBackground]:
    """Return poses that were not chosen by their index, judged by it; else as :func:`choose`."""
    model, seen, rows = what_is_seen(cell, pool)
    least = -(-seen.rank // model.width)
    _check_count(len(chosen), least, len(pool), seen.rank)
    sizes = [n for n in CURVE_SIZES if least < n <= len(pool)]
    with CurveInBackground(rows, sizes, index, seed) as curve:
        certificate = bound(rows, index, poses=len(chosen))
        choice = _choice(model, seen, rows, pool, chosen, certificate)
    return choice, curve


def _choice(
    model: Model, seen: Identifiability, rows: Array, pool: PoseSet, chosen: np.ndarray, certificate: Certificate
) -> Choice:
    q, fixture = pool.q[chosen], pool.fixture[chosen]
    ball = None if pool.ball is None else pool.ball[chosen]
    index, final = certificate.index, model.jacobian(q, fixture)
    value, grid = index_value(index, final), index_value(index, rows[chosen])
    raw, scaled = indices(final), indices(final, model.prior)
    return Choice(model, seen, q, fixture, chosen, index, value, grid, certificate, raw, scaled, ball)


def _selected(rows: Array, n: int, index: str, seed: int, certificate: Certificate, pool: PoseSet) -> np.ndarray:
    """Positions of the chosen candidates: by exchange, or by DETMAX with as many at each ball."""
    if pool.ball is None:
        return exchange(rows, n, index, seed=seed, certificate=certificate).chosen
    return detmax(rows, n, seed=seed, group=pool.ball)


def refined(cell: Cell, choice: Choice, seed: int) -> Choice:
    """Move the chosen poses continuously to better the index, each on its own fixture and keeping every filter."""
    if not cell.plan.refine or choice.ball is not None:
        return choice
    filters = [(Workspace(cell, k), CollisionWorld.from_cell(cell, k)) for k in range(len(cell.fixtures))]

    def rows(states: Array, pose: np.ndarray) -> Array:
        return choice.model.jacobian(states, choice.fixture[pose])

    def valid(states: Array, pose: np.ndarray) -> np.ndarray:
        ok = np.zeros(len(states), dtype=bool)
        for k, (workspace, world) in enumerate(filters):
            mine = np.flatnonzero(choice.fixture[pose] == k)
            mine = mine[(workspace.margins(states[mine]) > ROOM).all(axis=1)]
            ok[mine] = ~world.collides(states[mine], cell.motion.clearance + ROOM)
        return ok

    return choice.moved(refine(choice.q, rows, valid, choice.index, seed=seed).q)


def _check_count(poses: int | None, least: int, candidates: int, parameters: int) -> None:
    if poses is not None and poses < least:
        raise InputError(
            f"{poses} poses cannot identify {parameters} parameters: ask for at least {least}, better "
            f"{int(1.5 * least)}, or free fewer in [plan]"
        )
    if candidates < (poses or least):
        raise NoSolutionError(
            f"only {candidates} candidate poses are left, fewer than the {poses or least} wanted: "
            "widen the cones, the cable's budget or the clearance, or raise plan.candidates"
        )
