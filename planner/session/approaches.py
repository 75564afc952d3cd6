"""What is inserted into the path of a tour: supports that give the wanted side of approach, and the ways to balls."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.common.units import DEG, Array, read_only, round_angles
from planner.motion.path.constraints import Constraints
from planner.motion.path.verdict import PathLeg, ProvenPath, SeparateMotions, judge_path
from planner.session.course import Role
from planner.session.plan_types import motion_signs

REACHES = (3.0 * DEG, 1.5 * DEG, 0.75 * DEG)  # [rad] past the pose, the first that keeps every constraint


@dataclass(frozen=True)
class TourStop:
    """A pose to be visited.

    Attributes:
        q: controller angles, (N,) [rad].
        role: what the pose is for.
        approach: wanted sign of each axis' last movement (N,), 0 where any will do.
        ball: which ball is centred there, or −1.
        back: where the ball is approached from, (N,) [rad].
        times: how often it is centred in a row.
    """

    q: Array
    role: Role
    approach: Array | None = None
    ball: int = -1
    back: Array | None = None
    times: int = 1

    @property
    def node(self) -> Array:
        """Return where the tour passes, (N,) [rad]."""
        return self.q if self.back is None else self.back


def approach_from_sides(constraints: Constraints, path: ProvenPath, wanted: Sequence[Array]) -> tuple[ProvenPath, int]:
    """Return a path that comes to its poses from the wanted sides, and at how many poses it cannot.

    Args:
        constraints: what every motion keeps.
        path: of a tour.
        wanted: sign of each axis' last movement for every node of the path (n, N); where it is 0 any will do.
    """
    signs_wanted = np.array([wanted[k] if k >= 0 else np.zeros(path.q.shape[1]) for k in path.node])
    other = ((motion_signs(path.q) != signs_wanted) & (signs_wanted != 0)).any(axis=1) & (path.node >= 0)
    at = np.flatnonzero(other)
    at = at[at > 0]
    before, pose, sign = path.q[at - 1], path.q[at], signs_wanted[at]
    past = np.full(pose.shape, np.nan)
    for reach in REACHES:
        left = np.flatnonzero(np.isnan(past[:, 0]))
        if not len(left):
            break
        way = np.clip(pose[left] - before[left], -reach, reach)
        tries = round_angles(pose[left] - np.where(sign[left] != 0, reach * sign[left], way))
        ok = _prove_motions(constraints, before[left], tries) & _prove_motions(constraints, tries, pose[left])
        past[left[ok]] = tries[ok]
    reached = ~np.isnan(past[:, 0])
    longer = _insert_supports(path, at[reached], past[reached])
    first, second = judge_path(constraints, longer.q)
    if not (first.clear and second.clear):
        return path, len(at)
    return replace(longer, verdict=first, second=second), int((~reached).sum())


def _prove_motions(constraints: Constraints, q_from: Array, q_to: Array) -> np.ndarray:
    """Whether both engines prove the straight motions, (m,) bool."""
    out = constraints.prove(q_from, q_to).proven.copy()
    which = np.flatnonzero(out)
    if len(which):
        out[which] = constraints.judge(np.stack([q_from[which], q_to[which]], axis=1)).proven
    return np.asarray(out)


def _insert_supports(path: ProvenPath, at: np.ndarray, past: Array) -> ProvenPath:
    """Put support poses (m, N) before the way points ``at`` (m,)."""
    q, node = np.insert(path.q, at, past, axis=0), np.insert(path.node, at, -1)
    node.setflags(write=False)
    places = np.flatnonzero(node >= 0)
    legs = [
        PathLeg(leg.start, leg.end, read_only(q[a + 1 : b]))
        for leg, a, b in zip(path.legs, places, places[1:], strict=False)
    ]
    return replace(path, q=read_only(q), node=node, legs=tuple(legs))


def insert_ball_approaches(path: ProvenPath, stops: Sequence[TourStop]) -> tuple[ProvenPath, np.ndarray]:
    """Return the path with the ways to the balls in it, and which of its points are approach poses, (m,) bool.

    The path counts as node what is visited: at a ball its centre, not the pose that it is approached from.
    """
    q: list[Array] = []
    node: list[int] = []
    touched: list[bool] = []
    for point, k in zip(path.q, path.node.tolist(), strict=True):
        stop = stops[k - 1] if k > 0 else None
        if stop is None or stop.back is None:
            times = 1 if stop is None else stop.times
            q, node, touched = q + [point] * times, node + [k] * times, touched + [False] * times
            continue
        centre = round_angles(stop.q)
        q += [point, *[centre, point] * stop.times]
        node += [-1, *[k, -1] * stop.times]
        touched += [True, *[False, True] * stop.times]
    numbers = np.array(node)
    numbers.setflags(write=False)
    return replace(path, q=round_angles(np.array(q)), node=numbers), np.array(touched)


def ball_motions(away: Constraints, path: ProvenPath, stops: Sequence[TourStop]) -> list[SeparateMotions]:
    """The motions to and from the balls, ball by ball, with the constraints that hold there."""
    ball = np.array([stops[k - 1].ball if k > 0 else -1 for k in path.node])
    of_motion = np.maximum(ball[:-1], ball[1:])
    balls = np.unique(of_motion[of_motion >= 0]).tolist()
    return [SeparateMotions(away.at_ball(b), np.flatnonzero(of_motion == b)) for b in balls]
