"""Moves an inner number off its grid to where it explains most."""

import numpy as np

from planner.catalogue import Entry
from planner.tracing.inner_grid import spacing, within
from planner.tracing.screen import Shade, scored

NARROWINGS = 4  # rounds of the search between grid neighbours, each five times finer


def refined(shade: Shade, entry: Entry, value: float) -> float:
    """Move the inner number off its grid to where it explains most."""
    width = spacing(entry, value)
    for _ in range(NARROWINGS):
        tries = value + width * np.linspace(-1, 1, 11)
        tries = np.unique([within(entry, float(v)) for v in tries])
        gains = [s.gain for s in scored(shade, shade.lay_out([(entry, float(v)) for v in tries]))]
        value = float(tries[int(np.argmax(gains))])
        width /= 5
    return value
