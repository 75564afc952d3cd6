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

    ``unloaded``, ``loaded``: by one kind of run alone; ``both``: by one fit of all. ``prior`` sizes in ``units``.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    prior: Array
    unloaded: Array
    loaded: Array
    both: Array

    def of(self, start: str) -> tuple[tuple[str, float, float, float], ...]:
        """Rows (name, unloaded, loaded, both) of the parameters whose names begin so."""
        rows = zip(self.names, self.unloaded, self.loaded, self.both, strict=True)
        return tuple((n, float(u), float(w), float(b)) for n, u, w, b in rows if n.startswith(start))


@dataclass(frozen=True)
class Part:
    """Rows (n, P) of one kind of run in standard deviations of a reading, with names, units and prior sizes.

    What belongs to one gauge alone, its fixtures and zero, is named after it.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    prior: Array
    rows: Array

    def on(self, names: Sequence[str]) -> Array:
        """Rows per prior size with the columns of ``names``, (n, len(names)); nought where it has none of them."""
        out = np.zeros((len(self.rows), len(names)))
        here = [n for n in self.names if n in names]
        which = [self.names.index(n) for n in here]
        out[:, [list(names).index(n) for n in here]] = self.rows[:, which] * self.prior[which]
        return out


def predicted_both(free_cell: Cell, q: Array, fixture: np.ndarray, cell: Cell, places: Sequence[Candidate]) -> Both:
    """Predict what unloaded poses and loaded circles know, each alone and together.

    Each gauge has its own fixtures and zero; the tool point is common where both cells have the same, geometry and
    compliances are.

    Args:
        free_cell: cell of the poses without load.
        q: controller angles of its poses, (n, N) [rad]; fixture: which holds the bar, (n,) int.
        cell: with the loaded circle; places: where it is driven.

    Raises:
        InputError: the cells have different robots.
    """
    check_robots(free_cell, cell)
    first = unloaded_part(free_cell, q, fixture)
    second = loaded_part(cell, places, one_tool(free_cell, cell))
    names = (*first.names, *(n for n in second.names if n not in first.names))
    common = [k for k, n in enumerate(names) if n in first.names and n in second.names]
    one, other = first.on(names), second.on(names)
    size = np.ones(len(names))
    known = [covariance(rows, 1.0, size).std for rows in (one, other, np.concatenate([one, other]))]
    where = [first.names.index(names[k]) for k in common]
    return Both(
        tuple(names[k] for k in common),
        tuple(first.units[k] for k in where),
        frozen(first.prior[where]),
        *(frozen(s[common]) for s in known),
    )


def check_robots(free_cell: Cell, cell: Cell) -> None:
    """Refuse two cells with different robots.

    Raises:
        InputError: with both names.
    """
    if free_cell.robot.name != cell.robot.name:
        raise InputError(
            f"{free_cell.path} has the robot {free_cell.robot.name}, but {cell.path} has {cell.robot.name}; one fit "
            "needs one robot"
        )


def one_tool(free_cell: Cell, cell: Cell) -> bool:
    """Tell whether both bars hang from the same ball of the same tool."""
    one, other = free_cell.tool, cell.tool
    same = np.allclose(one.p_FM, other.p_FM) and np.allclose(one.com_F, other.com_F)
    return bool(same and np.isclose(one.mass, other.mass))


def unloaded_part(cell: Cell, q: Array, fixture: np.ndarray) -> Part:
    """Return the rows of poses without load, q (n, N) [rad], and which fixture (n,) int holds the bar."""
    rig = rig_of(cell)
    model = Model.of(rig, cell.plan.free).plus(compliance_parameters(rig))
    rows = model.rows(rig.visits(q, fixture))[:, 0] / model.noise(q, fixture)[:, None]
    return _named(model, rows, "unloaded ", True)


def loaded_part(cell: Cell, places: Sequence[Candidate], shared_tool: bool) -> Part:
    """Return the rows of loaded circles, every angle, load and sense; places are named P1 …"""
    rig = rig_of(cell)
    names = tuple(f"P{k + 1}" for k in range(len(places)))
    p_BX, prior = np.array([p.p_BX for p in places]), np.repeat(rig.place_prior[:1], len(places))
    rig = replace(rig, p_BX=p_BX, place_names=names, place_prior=prior)
    samples, noise = _circles(cell, rig, places)
    model = Model.of(rig, cell.plan.free).plus(compliance_parameters(rig))
    return _named(model, model.rows(samples)[:, 0] / noise[:, None], "loaded ", shared_tool)


def _named(model: Model, rows: Array, whose: str, shared_tool: bool) -> Part:
    def name(plain: str, group: str) -> str:
        return f"{whose}{plain}" if group == "gauge" and not (shared_tool and plain.startswith("map_")) else plain

    names = tuple(name(p.name, p.group) for p in model.parameters)
    return Part(names, tuple(p.unit for p in model.parameters), model.prior, rows)


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
