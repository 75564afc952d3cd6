"""Numbers inside the basis functions — frequencies, time constants — refined and given a standard deviation.

The derivative of the prediction by the inner number joins the model as one further parameter, so that the number is
fitted like all others and its uncertainty carries over to the rest.
"""

from dataclasses import replace

import numpy as np

from planner.catalogue import Entry
from planner.effects.combined import Times
from planner.model import Move, Parameter
from planner.tracing.screen import Shade, scored
from planner.units import Array

NARROWINGS = 4  # rounds of the search between grid neighbours, each five times finer
STEP = 1e-3  # of the grid's spacing, for the derivative


def spacing(entry: Entry, value: float) -> float:
    """Distance of the grid's neighbours at ``value``."""
    assert entry.inner is not None
    values = np.sort(entry.inner.values)
    if len(values) < 2:
        return abs(value) * 0.1
    k = int(np.clip(np.searchsorted(values, value), 1, len(values) - 1))
    return float(values[k] - values[k - 1])


def refined(shade: Shade, entry: Entry, value: float) -> float:
    """Move the inner number off its grid to where it explains most."""
    width = spacing(entry, value)
    for _ in range(NARROWINGS):
        tries = value + width * np.linspace(-1, 1, 11)
        tries = tries[tries > 0] if value > 0 else tries
        gains = [s.gain for s in scored(shade, shade.lay_out([(entry, float(v)) for v in tries]))]
        value = float(tries[int(np.argmax(gains))])
        width /= 5
    return value


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
