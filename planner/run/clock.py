"""Sessions, and whether samples are poses at rest or follow each other along a path: what the time column says."""

import numpy as np

from planner.errors import InputError
from planner.run.source import Source
from planner.run.types import IntArray
from planner.units import Array

DENSE = 0.2  # [s] median step of time below which samples may follow each other along a path
SMALL_STEP = 0.1  # [rad] median movement between such neighbours: 0.5 rad/s at DENSE, several at a controller's cycle


def looks_continuous(t: Array | None, q: Array) -> bool:
    """Return whether samples follow each other closely in time (n,) [s] and in joint angles (n, N) [rad]."""
    if t is None or len(t) < 3:
        return False
    step = np.median(np.abs(np.diff(t)))
    return bool(step < DENSE and np.median(np.abs(np.diff(q, axis=0)).max(axis=1)) < SMALL_STEP)


def sessions(t: Array | None, given: Array | None, n: int) -> tuple[IntArray, IntArray]:
    """Return the number of each sample's session (n,), from 0 on, and the rows where a clock steps back.

    A session that is named in the data keeps its samples together wherever they stand; without names a session ends
    where the clock steps back.
    """
    named = np.zeros(n, dtype=np.int64) if given is None else _in_order(given)
    if t is None:
        return named, np.empty(0, dtype=np.int64)
    back = 1 + np.flatnonzero((np.diff(t) < 0.0) & (named[1:] == named[:-1]))
    if given is None:
        named[back] = 1
        named = np.cumsum(named)
    return named, back


def check_order(source: Source, t: Array, session: IntArray) -> None:
    """Check that the clock of a continuous run goes forward within each session.

    Raises:
        InputError: with the line where time (n,) [s] stands still or runs backwards.
    """
    back = 1 + np.flatnonzero((np.diff(t) < 0.0) & (np.diff(session) == 0))
    if len(back):
        row = int(back[0])
        raise InputError(
            f"{source.at(row)}, column '{source.header('t')}': time runs backwards from {t[row - 1]:g} s to "
            f"{t[row]:g} s in a continuous run; split the file there, or give each part its own number in a column "
            "session (in a log of poses at rest, '# measure: static' above the columns allows it)"
        )
    still = 1 + np.flatnonzero((np.diff(t) == 0.0) & (np.diff(session) == 0))
    if len(still):
        raise InputError(
            f"{source.at(int(still[0]))}, column '{source.header('t')}': the time {t[still[0]]:g} s stands twice "
            f"({len(still)} such lines); in a continuous run each sample has its own"
        )


def _in_order(values: Array) -> IntArray:
    """Number values by their first appearance."""
    _, first, inverse = np.unique(values, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return np.asarray(rank[inverse])
