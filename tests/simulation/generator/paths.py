"""Continuous runs: a smooth way through poses in the shell, driven forth and back, the bar in range all the way."""

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from tests.simulation.generator.poses import least_norm, limits, point, point_jacobian, reach, uniform

TOOL_SPEED = 0.05  # [m/s] largest speed of the measured point
JOINT_SPEED = 0.25  # [rad/s] largest joint speed
STEP = 0.7  # [rad] largest joint step from waypoint to waypoint, about
INSIDE = 0.1  # [rad] off the joint limits
TRIES = 48  # poses that are tried for the next waypoint
FINE = 60  # samples a leg for finding out what may be driven


def wander(arm, start, count, centre, tool, lengths, rng):
    """Waypoints (count, N) in the shell, each within a modest joint step of the one before."""
    lower, upper = limits(arm)
    q = [start]
    while len(q) < count:
        way = uniform(arm, TRIES, rng) - q[-1]
        near = q[-1] + way * (STEP * rng.uniform(0.5, 1.0, (TRIES, 1)) / np.max(np.abs(way), axis=1, keepdims=True))
        bar = point(arm, near, tool) - centre
        far = np.linalg.norm(bar, axis=1, keepdims=True)
        aim = centre + bar / far * rng.uniform(*lengths, (TRIES, 1))
        there, gap = reach(arm, near, aim, tool, 5)
        good = (gap < 1e-5) & np.all((there > lower + INSIDE) & (there < upper - INSIDE), axis=1)
        good &= (bar[:, 2] > 0.17 * far[:, 0]) & (np.max(np.abs(there - q[-1]), axis=1) < 1.5 * STEP)
        if np.any(good):
            q.append(there[np.flatnonzero(good)[0]])
        elif len(q) > 1:
            q.pop()
        else:
            raise ValueError(f"{arm.name} cannot leave its first pose")
    return np.array(q)


def drive(arm, waypoints, centre, tool, lengths, n_rows, both_ways=True):
    """Times (n,) [s], angles (n, N) [rad] and speeds (n, N) [rad/s] of a run through waypoints (m, N).

    Waypoints that cannot be joined smoothly are left out.
    """
    way = _Way(arm, waypoints, centre, tool, lengths)
    while len(bad := way.bad_waypoints()):
        waypoints = np.delete(waypoints, bad[:: max(1, len(bad) // 4)], axis=0)
        if len(waypoints) < 5:
            raise ValueError(f"no smooth way through the shell for {arm.name}")
        way = _Way(arm, waypoints, centre, tool, lengths)
    clock = _clock(way, arm, tool)
    span = clock[0][-1] * (2 if both_ways else 1)
    t = np.linspace(0.0, span, n_rows)
    s = PchipInterpolator(*clock)(np.minimum(t, span - t) if both_ways else t)
    q = np.concatenate([way(s[k : k + 20_000]) for k in range(0, n_rows, 20_000)])
    return t, q, np.gradient(q, t, axis=0)


class _Way:
    """Joint angles over the path number s: a spline of the waypoints, drawn onto a spline of the bar."""

    def __init__(self, arm, waypoints, centre, tool, lengths):
        self.arm, self.centre, self.tool, self.waypoints = arm, centre, tool, waypoints
        self.knots = np.arange(len(waypoints), dtype=float)
        bar = point(arm, waypoints, tool) - centre
        length = np.linalg.norm(bar, axis=1)
        self.lengths = lengths
        self.joints = CubicSpline(self.knots, waypoints)
        self.direction, self.length = CubicSpline(self.knots, bar / length[:, None]), CubicSpline(self.knots, length)

    def target(self, s):
        e = self.direction(s)
        middle, half = np.mean(self.lengths), 0.5 * np.diff(self.lengths)[0]
        length = middle + half * np.tanh((self.length(s) - middle) / half)
        return self.centre + e / np.linalg.norm(e, axis=1, keepdims=True) * length[:, None]

    def __call__(self, s):
        q, x_wanted = self.joints(s), self.target(s)
        for _ in range(6):
            x, J = point_jacobian(self.arm, q, self.tool)
            q = q + np.clip(least_norm(J, x_wanted - x), -0.3, 0.3)
        return q

    def bad_waypoints(self):
        """Ends of legs that leave the joint limits, are not smooth, or lose the bar."""
        s = np.linspace(0, self.knots[-1], FINE * (len(self.knots) - 1) + 1)
        q = self(s)
        lower, upper = limits(self.arm)
        off = np.linalg.norm(point(self.arm, q, self.tool) - self.target(s), axis=1) > 1e-4
        off |= np.any((q < lower) | (q > upper), axis=1)
        step = np.max(np.abs(np.diff(q, axis=0, prepend=q[:1])), axis=1)
        bend = np.max(np.abs(np.diff(q, 2, axis=0, prepend=q[:1], append=q[-1:])), axis=1)
        off |= (step > 0.2) | (bend > 0.02)
        return np.unique(np.ceil(s[off]).astype(int))


def _clock(way, arm, tool):
    """(times, path numbers): as fast as the speeds allow, gently at both ends."""
    s = np.linspace(0, way.knots[-1], FINE * (len(way.knots) - 1) + 1)
    q = way(s)
    far = np.linalg.norm(np.diff(point(arm, q, tool), axis=0), axis=1)
    need = np.maximum(far / TOOL_SPEED, np.max(np.abs(np.diff(q, axis=0)), axis=1) / JOINT_SPEED)
    need = np.convolve(np.pad(need, 10, mode="edge"), np.ones(21) / 21, mode="valid")
    ends = np.minimum(np.arange(len(need)) + 0.5, len(need) - np.arange(len(need)) - 0.5) / FINE
    need = need / np.sqrt(np.clip(ends, 1e-3, 1.0))
    return np.concatenate([[0.0], np.cumsum(need)]), s
