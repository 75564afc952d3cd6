"""From chosen steps to time: each timed by ruckig with one degree of freedom along the path, laid end to end.

Where ruckig's tolerances leave it without an answer, or it is not installed, the same profile is written down in
closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.common.errors import PlannerError
from planner.common.units import Array, read_only
from planner.motion.planning_packages import is_installed, ruckig
from planner.motion.timing.curve import Mask
from planner.motion.timing.profile import Steps
from planner.motion.timing.ramps import double_s_phases
from planner.motion.tolerances import PHASE_TOLERANCE


@dataclass(frozen=True)
class Phases:
    """s(t) as K polynomials of degree three.

    t (K,) [s] when each begins; s [m], speed [m/s], acceleration [m/s²] at that time and jerk [m/s³] throughout, each
    (K,); begin, end (K,) the s between which the step that a phase belongs to moves; duration [s] of all together.
    """

    t: Array
    s: Array
    speed: Array
    acceleration: Array
    jerk: Array
    begin: Array
    end: Array
    duration: float

    def at(self, t: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return s, ds/dt, d²s/dt², d³s/dt³ and the step's last s, each (n,), at times t (n,) in [0, duration]."""
        k = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, None)
        x = t - self.t[k]
        v, a, j = self.speed[k], self.acceleration[k], self.jerk[k]
        s = self.s[k] + x * (v + x * (a / 2.0 + x * j / 6.0))
        s = np.clip(s, self.begin[k], self.end[k])
        return s, v + x * (a + x * j / 2.0), a + x * j, j, self.end[k]

    def time_at(self, s: Array) -> Array:
        """Return the first time (n,) at which each s (n,) is reached."""
        k = np.clip(np.searchsorted(self.s, s, side="left") - 1, 0, None)
        low = self.t[k]
        high = np.append(self.t, self.duration)[k + 1]
        for _ in range(60):
            middle = 0.5 * (low + high)
            x = middle - self.t[k]
            way = self.s[k] + x * (self.speed[k] + x * (self.acceleration[k] / 2.0 + x * self.jerk[k] / 6.0))
            low, high = np.where(way < s, middle, low), np.where(way < s, high, middle)
        return high


def time_steps(steps: Steps, edge: Array, wait: Array) -> tuple[Phases, Array]:
    """Time the steps that end at ``edge`` [m], with a rest of ``wait`` [s] at each end, both (S + 1,).

    Returns the phases and the time (S+1,) [s] of arrival at each end at which a step begins or ends, NaN at the others.
    """
    moves = _time_moves(steps)
    moves[:, :, 1] += edge[steps.first][:, None]
    at = np.append(steps.first, len(edge) - 1)
    rest = np.zeros((len(at), 1, 5))
    rest[:, 0, 0], rest[:, 0, 1] = wait[at], edge[at]
    nothing = np.zeros((1, 7, 5))
    table = np.concatenate([rest, np.concatenate([moves, nothing])], axis=1).reshape(-1, 5)[:-7]
    start = np.concatenate([[0.0], np.cumsum(table[:, 0])])
    arrival = np.full(len(edge), np.nan)
    arrival[at] = start[:-1:8]
    kept = table[:, 0] > 0.0
    kept[-1] = True  # the rest at the end, though it lasts no time
    s, speed, acceleration, jerk = (read_only(column) for column in table[kept, 1:].T)
    rows = np.repeat(np.arange(len(at)), 8)[:-7]
    is_rest = np.arange(len(rows)) % 8 == 0
    begin, end = edge[at[rows]], edge[at[np.minimum(rows + ~is_rest, len(at) - 1)]]
    t = read_only(start[:-1][kept])
    phases = Phases(t, s, speed, acceleration, jerk, read_only(begin[kept]), read_only(end[kept]), float(start[-1]))
    return phases, read_only(arrival)


def stand_still(wait: float) -> Phases:
    """Return the phases of a tour that rests at its only point for ``wait`` [s]."""
    zero = read_only(np.zeros(1))
    return Phases(zero, zero, zero, zero, zero, zero, zero, wait)


def _time_moves(steps: Steps) -> Array:
    """Return duration, s, ds/dt, d²s/dt², d³s/dt³ at the start of the seven phases of every step: (n, 7, 5)."""
    if not np.isfinite(steps.time()).all():
        raise PlannerError("a step of the path was given speeds that its limits do not allow")
    if is_installed("ruckig"):
        phases, solved = _ruckig_phases(steps)
    else:
        phases, solved = np.zeros((len(steps.length), 7, 5)), np.zeros(len(steps.length), dtype=bool)
    left = steps.take(np.flatnonzero(~solved))
    phases[~solved] = double_s_phases(left.length, left.v0, left.v1, left.speed, left.acceleration, left.jerk)
    return phases


def _ruckig_phases(steps: Steps) -> tuple[Array, Mask]:
    """Return ruckig's seven phases of every step (n, 7, 5), and for which steps (n,) it found a move to be driven.

    Each is solved with its length and its speed bound as the units, so ruckig's absolute tolerances suit most sizes.
    """
    time_unit = steps.length / steps.speed
    scaled = np.column_stack(
        [
            steps.v0 / steps.speed,
            steps.v1 / steps.speed,
            steps.acceleration * time_unit / steps.speed,
            steps.jerk * time_unit**2 / steps.speed,
        ]
    )
    solver, move, answer = ruckig.Ruckig(1), ruckig.InputParameter(1), ruckig.Trajectory(1)
    move.current_position, move.current_acceleration = [0.0], [0.0]
    move.target_position, move.target_acceleration = [1.0], [0.0]
    move.max_velocity = [1.0]
    rows, solved = [], []
    for v0, v1, acceleration, jerk in scaled.tolist():
        move.current_velocity, move.target_velocity = [v0], [v1]
        move.max_acceleration, move.max_jerk = [acceleration], [jerk]
        solved.append(_is_solved(solver, move, answer))
        p = answer.profiles[0][0]
        rows.append((p.t, p.p[:7], p.v[:7], p.a[:7], p.j))
    unit = np.column_stack([time_unit, steps.length, steps.speed, steps.speed / time_unit, steps.speed / time_unit**2])
    return np.array(rows).transpose(0, 2, 1) * unit[:, None, :], np.array(solved)


def _is_solved(solver: ruckig.Ruckig, move: ruckig.InputParameter, answer: ruckig.Trajectory) -> bool:
    """Tell whether ruckig finds a move that ends where it should and keeps its bounds throughout."""
    try:
        result = solver.calculate(move, answer)
    except ruckig.RuckigError:  # its tolerances are absolute: a feasible move at the edge of its limits can fail them
        return False
    p = answer.profiles[0][0]
    at_end = abs(p.p[7] - 1.0) <= PHASE_TOLERANCE and abs(p.v[7] - move.target_velocity[0]) <= PHASE_TOLERANCE
    within = p.brake.duration == 0.0 and min(p.v) >= -PHASE_TOLERANCE and max(p.v) <= 1.0 + PHASE_TOLERANCE
    # seen 9 % beyond it, near its edges
    gentle = max(map(abs, p.a)) <= move.max_acceleration[0] * (1.0 + PHASE_TOLERANCE)
    return bool(result == ruckig.Result.Working and at_end and within and gentle)
