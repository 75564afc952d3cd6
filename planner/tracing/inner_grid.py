"""Numbers inside the basis functions — frequencies, time constants — on their grids, and as parameters of the model.

The derivative of the prediction by the inner number joins the model as one further parameter, so that the number is
fitted like all others and its uncertainty carries over to the rest.
"""

from dataclasses import replace

import numpy as np

from planner.catalogue import Entry
from planner.effects.combined import Times
from planner.model import Move, Parameter
from planner.units import Array

STEP = 1e-3  # of the grid's spacing, for the derivative


def spacing(entry: Entry, value: float) -> float:
    """Distance of the grid's neighbours at ``value``."""
    assert entry.inner is not None
    values = np.sort(entry.inner.values)
    if len(values) < 2:
        return abs(value) * 0.1
    k = int(np.clip(np.searchsorted(values, value), 1, len(values) - 1))
    return float(values[k] - values[k - 1])


def within(entry: Entry, value: float) -> float:
    """Keep an inner number inside its grid: beyond it other entries begin."""
    assert entry.inner is not None
    return float(np.clip(value, entry.inner.values.min(), entry.inner.values.max()))


def slope(entry: Entry, value: float, sizes: Array) -> Parameter:
    """Return the parameter that moves the inner number about ``value``, the effect's parameters being ``sizes``."""
    assert entry.inner is not None
    h = STEP * spacing(entry, value)
    moves: list[Move] = []
    for sign in (1.0, -1.0):
        for parameter, size in zip(entry.make(value + sign * h), sizes, strict=True):
            factor = float(sign * size / (2 * h))
            moves += [Move(m.on, m.index, Times(m.phi, factor)) for m in parameter.moves]
    first = entry.make(value)[0]
    return replace(
        first,
        name=f"{entry.name}, {entry.inner.name}",
        unit=entry.inner.unit,
        prior=2 * spacing(entry, value),
        what=f"{entry.inner.name} of {entry.name}",
        moves=tuple(moves),
    )
