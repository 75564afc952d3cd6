"""From chosen poses to a timed path for gauges without a bar: every ball is approached, centred and left the same way.

The tour runs over the approach poses; the last way to a ball is inserted where the tour stops at its approach pose. All
of it starts and ends where the head is mastered or the reflector is put in.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.cell.cell import Cell
from planner.common.units import Array
from planner.design.candidates.balls import FirstContact
from planner.design.candidates.pool import PoseSet
from planner.kinematics.bar_geometry import bar_state
from planner.motion.path.constraints import Constraints
from planner.motion.path.verdict import ProvenPath, SeparateMotions
from planner.motion.timing.trajectory import check_limits
from planner.motion.tour.solve import Method
from planner.session.bar_drive import LIMIT_SAMPLES, join_tour, path_to_mount
from planner.session.course import add_blends, axis_limits, release_path, round_angles
from planner.session.plan_types import Drive, Role, Visit, motion_signs

MANY = 250  # poses beyond which the order is proven to a fraction of a per cent only: that nobody waits for the rest


@dataclass(frozen=True)
class PointStop:
    """A pose to be visited ``times`` times in a row; at a ball ``back`` (N,) [rad] is where it is approached from."""

    q: Array
    role: Role
    ball: int = -1
    back: Array | None = None
    times: int = 1

    @property
    def node(self) -> Array:
        """Return where the tour passes, (N,) [rad]."""
        return self.q if self.back is None else self.back


def drive_points(
    cell: Cell, away: Constraints, stops: Sequence[PointStop], repeats: int, pool: PoseSet, tsp: Method, seed: int
) -> Drive:
    """Join the stops into a driven, timed and twice-judged tour from the mount pose and back to it.

    Args:
        cell: the cell.
        away: what the robot keeps while no ball is centred.
        stops: the poses.
        repeats: how many poses without a ball are visited again at the end.
        pool: the candidates; detours lead over them.
        tsp, seed: of the tour's solver, and of everything random.

    Raises:
        Unreachable: a stop cannot be reached; replace it and call again.
        NoSolutionError: no tour joins the poses, or a judge rejects the path.
    """
    mount = np.asarray(cell.fixtures[0].mount)
    nodes = np.vstack([mount, *[s.node for s in stops]])
    near = pool.q if pool.back is None else pool.back
    tour, joined, _ = join_tour(cell, nodes, repeats, away, near, tsp, seed, 0 if len(nodes) > MANY else None)
    travel = path_to_mount(away, np.vstack([cell.home, mount]), seed)
    path, touched = _insert_ball_approaches(joined, stops)
    visits = _number_visits(cell, path, stops)
    ids = np.full(len(path.q), -1)
    ids[path.node > 0] = [v.id for v in visits if v.role != "mount"]
    rests = (path.node >= 0) | touched
    way = add_blends(cell, away, travel, np.zeros(len(travel.q), dtype=bool), np.full(len(travel.q), -1))
    measuring = add_blends(cell, away, path, rests, ids)
    driven, verdicts = release_path(away, away, way, measuring, _ball_motions(away, path, stops))
    path = replace(path, verdict=verdicts[0], second=verdicts[1])
    step = max(driven.trajectory.duration_s / LIMIT_SAMPLES, 0.01)
    limits = check_limits(driven.trajectory, axis_limits(cell, bar=True), step)
    return Drive(0, visits, tour, path, travel, driven, limits, verdicts)


def _insert_ball_approaches(path: ProvenPath, stops: Sequence[PointStop]) -> tuple[ProvenPath, np.ndarray]:
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


def _ball_motions(away: Constraints, path: ProvenPath, stops: Sequence[PointStop]) -> list[SeparateMotions]:
    """The motions to and from the balls, ball by ball, with the constraints that hold there."""
    ball = np.array([stops[k - 1].ball if k > 0 else -1 for k in path.node])
    of_motion = np.maximum(ball[:-1], ball[1:])
    balls = np.unique(of_motion[of_motion >= 0]).tolist()
    return [SeparateMotions(away.at_ball(b), np.flatnonzero(of_motion == b)) for b in balls]


def _number_visits(cell: Cell, path: ProvenPath, stops: Sequence[PointStop]) -> tuple[Visit, ...]:
    """Number the poses in visiting order; a further visit of a pose is a repeat of the first."""
    at = np.flatnonzero(path.node >= 0)
    q, approach = path.q[at], motion_signs(path.q)[at]
    length = bar_state(cell.map_position(q), cell.fixtures[0].p_BX).length
    contact = FirstContact(cell).at(q) if cell.gauge.head else np.zeros(len(at))
    first: dict[int, int] = {}
    visits = []
    for k, node in enumerate(path.node[at].tolist()):
        again = node in first and node != 0
        stop = stops[node - 1] if node > 0 else None
        role: Role = "mount" if stop is None else "repeat" if again else stop.role
        sign = tuple(int(s) for s in approach[k])
        ball = -1 if stop is None else stop.ball
        met = float(contact[k]) if ball >= 0 else None
        visits.append(Visit(k, q[k], float(length[k]), 0, role, sign, first.get(node) if again else None, ball, met))
        first.setdefault(node, k)
    return tuple(visits)
