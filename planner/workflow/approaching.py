"""Poses come to from a wanted side: the arm first goes a little past them, so that play lies as the plan wants it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.path import Constraints, Leg, Path, judge
from planner.plan import settled, signs
from planner.units import DEG, Array, frozen

REACHES = (3.0 * DEG, 1.5 * DEG, 0.75 * DEG)  # [rad] past the pose, the first that keeps every constraint


def approached(constraints: Constraints, path: Path, wanted: Sequence[Array]) -> tuple[Path, int]:
    """Return a path that comes to its poses from the wanted sides, and at how many poses it cannot.

    Args:
        constraints: what every motion keeps.
        path: of a tour.
        wanted: sign of each axis' last movement for every node of the path (n, N); where it is 0 any will do.
    """
    signs_wanted = np.array([wanted[k] if k >= 0 else np.zeros(path.q.shape[1]) for k in path.node])
    other = ((signs(path.q) != signs_wanted) & (signs_wanted != 0)).any(axis=1) & (path.node >= 0)
    at = np.flatnonzero(other)
    at = at[at > 0]
    before, pose, sign = path.q[at - 1], path.q[at], signs_wanted[at]
    past = np.full(pose.shape, np.nan)
    for reach in REACHES:
        left = np.flatnonzero(np.isnan(past[:, 0]))
        if not len(left):
            break
        way = np.clip(pose[left] - before[left], -reach, reach)
        tries = settled(pose[left] - np.where(sign[left] != 0, reach * sign[left], way))
        ok = _proven(constraints, before[left], tries) & _proven(constraints, tries, pose[left])
        past[left[ok]] = tries[ok]
    reached = ~np.isnan(past[:, 0])
    longer = _with(path, at[reached], past[reached])
    first, second = judge(constraints, longer.q)
    if not (first.clear and second.clear):
        return path, len(at)
    return replace(longer, verdict=first, second=second), int((~reached).sum())


def _proven(constraints: Constraints, q_from: Array, q_to: Array) -> np.ndarray:
    """Whether both engines prove the straight motions, (m,) bool."""
    out = constraints.prove(q_from, q_to).proven.copy()
    which = np.flatnonzero(out)
    if len(which):
        out[which] = constraints.judge(np.stack([q_from[which], q_to[which]], axis=1)).proven
    return np.asarray(out)


def _with(path: Path, at: np.ndarray, past: Array) -> Path:
    """Put support poses (m, N) before the way points ``at`` (m,)."""
    q, node = np.insert(path.q, at, past, axis=0), np.insert(path.node, at, -1)
    node.setflags(write=False)
    places = np.flatnonzero(node >= 0)
    legs = [
        Leg(leg.start, leg.end, frozen(q[a + 1 : b])) for leg, a, b in zip(path.legs, places, places[1:], strict=False)
    ]
    return replace(path, q=frozen(q), node=node, legs=tuple(legs))
