"""The timed tour: an exact evaluator of where every joint is at any time, and the times that matter."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from planner.trajectory.curve import Curve
from planner.trajectory.limits import Mask, ToolJacobian
from planner.trajectory.timing import Phases
from planner.units import Array


@dataclass(frozen=True)
class Motion:
    """The state at n times: t (n,) [s]; q, dq, ddq, dddq (n, N) [rad, /s, /s², /s³]; s [m], tool_speed [m/s], (n,)."""

    t: Array
    q: Array
    dq: Array
    ddq: Array
    dddq: Array
    s: Array
    tool_speed: Array


@dataclass(frozen=True)
class Trajectory:
    """A tour over m path points, blended and timed.

    duration_s; measuring_s, the part on legs with a tool-speed limit and at rest beside them; waypoint_time (m,) [s] of
    coming to rest at a stop, or of closest passage (in joint space) where blended; dwell (m,) [s]; stop (m,), forced
    stops included; leg_duration (m-1,) [s] of moving, leg_peak_tool_speed and tool_speed_limit (m-1,) [m/s]; entry and
    exit (m, N) [rad] of each blend: the path stays inside the triangles (entry, point, exit) and on the legs.
    """

    duration_s: float
    measuring_s: float
    waypoint_time: Array
    dwell: Array
    stop: Mask
    leg_duration: Array
    leg_peak_tool_speed: Array
    tool_speed_limit: Array
    entry: Array
    exit: Array
    curve: Curve = field(repr=False)
    phases: Phases = field(repr=False)
    tool_jacobian: ToolJacobian = field(repr=False, compare=False)

    def at(self, t: ArrayLike) -> Motion:
        """Return the state at times t (n,) [s], held at rest outside [0, duration_s]."""
        return evaluate(self.curve, self.phases, self.tool_jacobian, np.atleast_1d(np.asarray(t, dtype=float)))

    def sample(self, dt: float) -> Motion:
        """Return the state every ``dt`` [s] from 0, and at the end."""
        return self.at(self.sample_times(dt))

    def sample_times(self, dt: float) -> Array:
        """Return 0, dt, 2 dt, … and duration_s."""
        return np.append(np.arange(np.ceil(self.duration_s / dt - 1e-9)) * dt, self.duration_s)


def evaluate(curve: Curve, phases: Phases, jacobian: ToolJacobian, t: Array) -> Motion:
    """Return the state at times t (n,): the chain rule through q(s) and s(t)."""
    s, v, a, j, end = phases.at(np.clip(t, 0.0, phases.duration))
    # what ends at a stop stays on its own piece, though rounding may put s past it
    q, d1, d2, d3 = curve.derivatives(s, np.minimum(curve.piece(s), curve.last_piece(end)))
    v, a, j = v[:, None], a[:, None], j[:, None]
    dq = d1 * v
    ddq = d2 * v**2 + d1 * a
    dddq = d3 * v**3 + 3.0 * d2 * v * a + d1 * j
    tool_speed = np.linalg.norm(np.einsum("nij,nj->ni", jacobian(q), dq), axis=1)
    return Motion(t, q, dq, ddq, dddq, s, tool_speed)
