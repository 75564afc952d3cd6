"""Readings that are believed: several in a row that agree."""

from collections import deque

import numpy as np

from planner.centring.errors import UnsettledError
from planner.centring.indicators import Indicators
from planner.centring.settings import RestFile
from planner.centring.stopping import Stop
from planner.units import UM, Array, frozen


def at_rest(indicators: Indicators, how: RestFile, stop: Stop) -> Array:
    """Wait for the arm to settle, read until enough readings in a row agree, and return their mean, (3,) [m].

    Raises:
        UnsettledError: they never do.
        SilentError: an indicator does not answer.
        StoppedError: a stop was asked for.
    """
    stop.wait(how.settle_s)
    last: deque[Array] = deque(maxlen=how.readings)
    for _ in range(max(how.most_readings, how.readings)):
        last.append(indicators.read())
        spread = np.ptp(np.array(last), axis=0)
        if len(last) == how.readings and np.all(spread <= how.spread_um * UM):
            return frozen(np.mean(np.array(last), axis=0))
    raise UnsettledError(
        f"after {how.most_readings} readings the last {how.readings} still spread over "
        f"{', '.join(f'{s / UM:.1f}' for s in spread)} µm (x, y, z); {how.spread_um:g} µm are allowed: "
        "does something shake the cell, or is an answer lost now and then?"
    )
