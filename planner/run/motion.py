"""How the joints moved: speeds from the stamps, and the stretches in which the arm stood still."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from planner.errors import InputError
from planner.run.types import IntArray, Samples
from planner.units import Array

BoolArray = NDArray[np.bool_]
REST_SPEED = 0.002  # [rad/s] 0.1 degree a second: slower than any measuring move, above an encoder's flicker
REST_TIME = 0.5  # [s] the shortest rest


def speeds(samples: Samples) -> Array:
    """Return joint speeds (n, N) [rad/s] by time differences within sessions.

    A parabola through each sample and its two neighbours (exact for constant acceleration, any spacing); a straight
    line at the ends of a session, zero where it has one sample.

    Raises:
        InputError: the run has no time, or two samples of a session have the same.
    """
    if samples.t is None:
        raise InputError("joint speeds need the time of each sample, but the run has no column t_s")
    t, q = samples.t, samples.q
    together = np.zeros(len(t) + 1, dtype=bool)  # whether sample i follows sample i − 1 in its session
    together[1:-1] = np.diff(session_of(samples)) == 0
    step = np.ones(len(t) + 1)
    step[1:-1] = np.diff(t)
    if (step[together] <= 0.0).any():
        raise InputError("joint speeds need a clock that goes forward, but two samples of a session have the same time")
    slope = np.zeros((len(t) + 1, q.shape[1]))
    slope[1:-1] = np.diff(q, axis=0) / step[1:-1, None]
    before, after = together[:-1], together[1:]
    weight = np.where(before & after, step[1:] / (step[1:] + step[:-1]), before.astype(float))[:, None]
    return np.asarray(slope[:-1] * weight + slope[1:] * np.where(after, 1.0 - weight[:, 0], 0.0)[:, None])


def session_of(samples: Samples) -> IntArray:
    """Return the session of each sample (n,); 0 where none is logged."""
    return np.zeros(len(samples), dtype=np.int64) if samples.session is None else samples.session


def stretches_at_rest(samples: Samples, speed: float = REST_SPEED, least: float = REST_TIME) -> IntArray:
    """Return first sample and end (exclusive) of each stretch at rest, (k, 2).

    The arm rests where no joint's angle changes by more than ``speed`` · ``least`` [rad] within ``least`` [s]: a
    difference over a time, not a speed, as encoder steps divided by a controller's cycle are large. A quarter of
    ``least`` is cut off at both ends, where the arm still brakes or already starts.

    Raises:
        InputError: the run has no time.
    """
    if samples.t is None:
        raise InputError("rests are found by time, but the run has no column t_s")
    t, q = samples.t, samples.q
    width, cut = _widths(t, least)
    if width > len(t):
        return np.empty((0, 2), dtype=np.int64)
    still = _range(q, width) <= speed * least  # (n − width + 1,) of the windows i … i + width − 1
    apart = _breaks(samples, least)
    part = np.concatenate([[0], np.cumsum(apart)])
    still &= part[width - 1 :] == part[: len(part) - width + 1]
    covered = np.zeros(len(t) + 1, dtype=np.int64)
    np.add.at(covered, np.flatnonzero(still), 1)
    np.add.at(covered, np.flatnonzero(still) + width, -1)
    at_rest = np.cumsum(covered[:-1]) > 0
    on = at_rest[1:] & at_rest[:-1] & ~apart  # the rest goes on from one sample to the next
    begins = at_rest & ~np.concatenate([[False], on])
    ends = at_rest & ~np.concatenate([on, [False]])
    return np.column_stack([np.flatnonzero(begins) + cut, np.flatnonzero(ends) + 1 - cut])


def _widths(t: Array, least: float) -> tuple[int, int]:
    """Return how many samples a rest has at least, and how many are cut off at either end of one."""
    step = float(np.median(np.abs(np.diff(t)))) if len(t) > 1 else least
    width = max(3, round(least / max(step, 1e-9)) + 1)
    return width, (width - 1) // 4


def _range(q: Array, width: int) -> Array:
    """Return the largest change of a joint in each window of ``width`` samples, (n − width + 1,) [rad]."""
    inside = slice(width // 2, width // 2 + len(q) - width + 1)
    high, low = maximum_filter1d(q, width, axis=0)[inside], minimum_filter1d(q, width, axis=0)[inside]
    return np.asarray((high - low).max(axis=1))


def _breaks(samples: Samples, gap: float) -> BoolArray:
    """Return whether something ends between each sample and the next, (n − 1,): a session, a pose, a fixture …"""
    ends = np.abs(np.diff(samples.t if samples.t is not None else samples.q[:, 0])) > gap
    for values in (samples.session, samples.pose, samples.place, samples.point):
        if values is not None:
            ends |= np.diff(values) != 0
    return np.asarray(ends, dtype=bool)


def last_directions(q: Array, first: IntArray, least: float = REST_SPEED * REST_TIME) -> Array:
    """Return the sign of each joint's last move before the samples ``first`` (k,), (k, N); 0 where it had not moved.

    Angles are counted in steps of ``least`` [rad]; a move is two steps in one direction, so that an encoder that
    flickers over the border of a step does not move.
    """
    signs = np.zeros((len(first), q.shape[1]))
    for joint, angle in enumerate(q.T):
        level = np.round(angle / least)
        change = np.diff(level)
        moved = np.flatnonzero(change)
        way = np.sign(change[moved])
        real = np.abs(change[moved]) > 1.0
        real[1:] |= way[1:] == way[:-1]
        moved, way = moved[real] + 1, np.append(way[real], 0.0)  # the last entry answers for "not yet"
        signs[:, joint] = way[np.searchsorted(moved, first, side="right") - 1]
    return signs
