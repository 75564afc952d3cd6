"""Rows of poses without load and of loaded circles, as one fit of both would weigh them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.cell import Cell
from planner.loaded.balance import by_held_torque, in_balance
from planner.loaded.refining import torque_rows, whitened_turns
from planner.model import Model
from planner.model.parameters import compliance_parameters
from planner.rig import rig_of
from planner.run import Samples
from planner.study.softness.choice import TYPICAL, planned_curves
from planner.study.softness.circles import Candidate
from planner.units import Array


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


def unloaded_part(cell: Cell, q: Array, fixture: np.ndarray) -> Part:
    """Return the rows of poses without load, q (n, N) [rad], and which fixture (n,) int holds the bar."""
    rig = rig_of(cell)
    model = Model.of(rig, cell.plan.free).plus(compliance_parameters(rig))
    rows = model.rows(rig.visits(q, fixture))[:, 0] / model.noise(q, fixture)[:, None]
    return _named(model, rows, "unloaded ", True)


def loaded_part(cell: Cell, places: Sequence[Candidate], shared_tool: bool) -> Part:
    """Return the rows of loaded circles, every angle, load and sense; places are named P1 … in the order given."""
    rig = rig_of(cell)
    names = tuple(f"P{k + 1}" for k in range(len(places)))
    p_BX, prior = np.array([p.p_BX for p in places]), np.repeat(rig.place_prior[:1], len(places))
    rig = replace(rig, p_BX=p_BX, place_names=names, place_prior=prior)
    model = Model.of(rig, cell.plan.free).plus(compliance_parameters(rig))
    rows = np.concatenate([_circle_rows(cell, model, k, c) for k, c in enumerate(places)])
    return _named(model, rows, "loaded ", shared_tool)


def _named(model: Model, rows: Array, whose: str, shared_tool: bool) -> Part:
    def name(plain: str, group: str) -> str:
        return f"{whose}{plain}" if group == "gauge" and not (shared_tool and plain.startswith("map_")) else plain

    names = tuple(name(p.name, p.group) for p in model.parameters)
    return Part(names, tuple(p.unit for p in model.parameters), model.prior, rows)


def _circle_rows(cell: Cell, model: Model, k: int, place: Candidate) -> Array:
    """Rows (n, P) of one circle, every load and sense, in standard deviations; the k-th of the model's places.

    They are those of the common fit, about joints that yield as is typical: the fixture's place turns the load, and
    what all loads have in common carries the error of a pose.
    """
    curves = planned_curves(cell, model.rig, place)
    D, K, A = curves.length.shape
    apart = np.fft.irfft(curves.noise, A)[(np.arange(A)[:, None] - np.arange(A)) % A]
    samples = Samples(curves.q.reshape(D * K * A, -1), np.full(D * K * A, k), force=curves.force.ravel())
    soft = np.array([p.group == "joint compliance" for p in model.parameters])
    held = replace(model, parameters=by_held_torque(model.parameters))
    errors = np.where(soft, TYPICAL * model.prior, 0.0)
    there = in_balance(model, samples, errors)[1]
    rows = held.rows(there, errors)[:, 0] + torque_rows(held, there, errors, model.prior)
    pose = model.noise(samples.q, samples.place) ** 2
    parts = zip(range(D), np.split(rows, D), np.split(pose, D), strict=True)
    return np.concatenate([whitened_turns(r, apart / curves.repeats[d, :, None, None], v) for d, r, v in parts])
