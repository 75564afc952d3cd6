"""What a plan without load and some loaded circles would know in one fit of geometry and compliances."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.cell import Cell
from planner.errors import InputError
from planner.model import Model
from planner.model.parameters import compliance_parameters
from planner.observability import covariance
from planner.rig import Rig, rig_of
from planner.run import Samples
from planner.study.softness.choice import planned_curves
from planner.study.softness.circles import Candidate
from planner.units import Array, frozen


@dataclass(frozen=True)
class Both:
    """Standard deviations per prior size, (P,) each, of geometry and compliances.

    ``unloaded``, ``loaded``: by one kind of run alone; ``both``: by one fit of all.
    """

    names: tuple[str, ...]
    unloaded: Array
    loaded: Array
    both: Array

    def of(self, start: str) -> tuple[tuple[str, float, float, float], ...]:
        """Rows (name, unloaded, loaded, both) of the parameters whose names begin so."""
        rows = zip(self.names, self.unloaded, self.loaded, self.both, strict=True)
        return tuple((n, float(u), float(w), float(b)) for n, u, w, b in rows if n.startswith(start))


def predicted_both(free_cell: Cell, q: Array, fixture: np.ndarray, cell: Cell, places: Sequence[Candidate]) -> Both:
    """Predict what unloaded poses and loaded circles know, each alone and together.

    Each gauge has its own fixtures, zero and tool point; geometry and compliances are common.

    Args:
        free_cell: cell of the poses without load.
        q: controller angles of its poses, (n, N) [rad]; fixture: which holds the bar, (n,) int.
        cell: with the loaded circle; places: where it is driven.

    Raises:
        InputError: the cells have different robots.
    """
    if free_cell.robot.name != cell.robot.name:
        raise InputError(
            f"{free_cell.path} has the robot {free_cell.robot.name}, but {cell.path} has {cell.robot.name}; one fit "
            "needs one robot"
        )
    first = _rows(rig_of(free_cell), Samples(q, fixture), free_cell.plan.free, "unloaded ")
    rig = rig_of(cell)
    p_BX = np.array([p.p_BX for p in places])
    names = tuple(f"P{k + 1}" for k in range(len(places)))
    rig = replace(rig, p_BX=p_BX, place_names=names, place_prior=np.repeat(rig.place_prior[:1], len(places)))
    samples, noise = _circles(cell, rig, places)
    second = _rows(rig, samples, cell.plan.free, "loaded ", noise)
    return _combined(first, second)


@dataclass(frozen=True)
class _Rows:
    """Rows (n, P) in standard deviations of a reading, with the names and prior sizes of their columns."""

    names: tuple[str, ...]
    prior: Array
    rows: Array


def _rows(rig: Rig, samples: Samples, free: frozenset[str], whose: str, noise: Array | None = None) -> _Rows:
    model = Model.of(rig, free).plus(compliance_parameters(rig))
    sigma = model.noise(samples.q, samples.place) if noise is None else noise
    names = tuple(f"{whose}{p.name}" if p.group == "gauge" else p.name for p in model.parameters)
    return _Rows(names, model.prior, model.rows(samples)[:, 0] / sigma[:, None])


def _circles(cell: Cell, rig: Rig, places: Sequence[Candidate]) -> tuple[Samples, Array]:
    """Every angle, load and sense of all circles, and the noise of each: that of the smooth curves, not of readings."""
    q, place, force, noise = [], [], [], []
    for k, c in enumerate(places):
        curves = planned_curves(cell, rig, c)
        n = curves.length.size
        q.append(curves.q.reshape(n, -1))
        place.append(np.full(n, k))
        force.append(curves.force.ravel())
        noise.append(np.sqrt(curves.noise[1] / np.repeat(curves.repeats.ravel(), curves.length.shape[2])))
    samples = Samples(np.concatenate(q), np.concatenate(place), force=np.concatenate(force))
    return samples, np.concatenate(noise)


def _combined(first: _Rows, second: _Rows) -> Both:
    names = (*first.names, *(n for n in second.names if n not in first.names))
    prior = np.array([dict(zip(s.names, s.prior, strict=True)).get(n, 0.0) for n in names for s in (first, second)])
    size = prior.reshape(-1, 2).max(axis=1)
    wide = []
    for part in (first, second):
        rows = np.zeros((len(part.rows), len(names)))
        rows[:, [names.index(n) for n in part.names]] = part.rows
        wide.append(rows)
    common = [k for k, n in enumerate(names) if n in first.names and n in second.names]
    known = [covariance(rows, 1.0, size).std / size for rows in (*wide, np.concatenate(wide))]
    return Both(tuple(names[k] for k in common), *(frozen(s[common]) for s in known))
