"""Legs of a stream of timed goals: how long each takes and how fast it is passed, within the limits of acceleration.

Whoever follows a stream knows nothing of the limits. A trajectory controller of ROS 2 joins goals that have velocities
by cubics; a servo arm takes one frame after the other at an even rate. So the ramps must be in the stream itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from planner.common.errors import InputError
from planner.common.units import Array
from planner.programs.instructions import JointMove
from planner.programs.motion_styles import SpeedStyle

PARTS = np.linspace(0.0, 1.0, 33)[:, None, None]  # of a leg, at which its speed is looked at
TICKS = 1e6  # [1/s] of the times in a trajectory


@dataclass(frozen=True)
class TimedLeg:
    """One leg: its time [s], the velocities at its end [deg/s], and the angles of the frames inside it [deg]."""

    seconds: float
    velocity_deg_s: tuple[float, ...]
    frames_deg: tuple[tuple[float, ...], ...] = ()


def time_legs(
    home_deg: tuple[float, ...],
    moves: Sequence[JointMove],
    stops: Sequence[bool],
    style: SpeedStyle,
    acceleration_deg_s2: tuple[float, ...],
) -> list[TimedLeg]:
    """Return the legs of a stream.

    Args:
        home_deg: where the first move begins.
        moves: the moves, of which no leg takes less than its planned time.
        stops: whether each ends at rest.
        style: of a dialect with a ``stream``.
        acceleration_deg_s2: limit of each joint; none where it is not known.

    Raises:
        InputError: a stretch in frames cannot be driven within the limits at that rate.
    """
    q = np.array([home_deg, *(m.q_deg for m in moves)])
    # 0.99: of the acceleration is used: printed angles and times are rounded
    limit = np.array(acceleration_deg_s2 or [np.inf] * q.shape[1]) * 0.99
    ends = [0, *(k + 1 for k, stop in enumerate(stops) if stop)]
    legs: list[TimedLeg] = []
    for a, b in pairwise(ends):
        if b - a > 1:
            legs += _pass_through(q[a : b + 1], moves[a:b], style, limit)
        elif style.stream == "frames":
            legs.append(_ramped_leg(q[a], q[b], moves[a].duration_s, float(style.word), limit))
        else:
            legs.append(_cubic_leg(q[a], q[b], moves[a].duration_s * style.ease, limit))
    return legs


def _zero_speeds(n_joints: int) -> tuple[float, ...]:
    return (0.0,) * n_joints


def _reach(begin: Array, end: Array, limit: Array) -> float:
    """Return the largest distance over acceleration of any joint [s²]."""
    return float((np.abs(end - begin) / limit).max())


def _cubic_leg(begin: Array, end: Array, seconds: float, limit: Array) -> TimedLeg:
    """A straight leg between two points at rest, joined by a cubic."""
    # 6.0: acceleration of the cubic between two points at rest, times its time squared, over the distance
    seconds = max(seconds, float(np.sqrt(6.0 * _reach(begin, end, limit))))
    return TimedLeg(float(np.ceil(seconds * TICKS - 1e-3) / TICKS), _zero_speeds(len(end)))


def _ramped_leg(begin: Array, end: Array, seconds: float, rate: float, limit: Array) -> TimedLeg:
    """A straight leg in frames: up to the even speed of the planned time, along, and down again."""
    reach = _reach(begin, end, limit)
    ramp = min(reach / seconds, float(np.sqrt(reach)))
    whole = max(seconds, ramp) + ramp
    count = max(1, int(np.ceil(whole * rate - 1e-6)))
    share = _ramped_share(np.arange(1, count) / count, ramp / whole)
    frames = begin + share[:, None] * (end - begin)
    return TimedLeg(count / rate, _zero_speeds(len(end)), tuple(map(tuple, frames.tolist())))


def _ramped_share(u: Array, ramp: float) -> Array:
    """Return the share of the way at shares u of the time, with ramps of that share of the time at both ends."""
    if ramp == 0.0:
        return u
    near = np.minimum(u, 1.0 - u)
    rising = np.where(near < ramp, near**2 / (2.0 * ramp), near - ramp / 2.0) / (1.0 - ramp)
    return np.where(u < 0.5, rising, 1.0 - rising)


def _pass_through(q: Array, moves: Sequence[JointMove], style: SpeedStyle, limit: Array) -> list[TimedLeg]:
    """Legs from rest to rest whose points q (n + 1, N) [deg] are passed: cubics, all slower where one has to be."""
    planned = np.array([m.duration_s for m in moves])
    shortest = np.array([m.duration_s if m.shortest_s is None else m.shortest_s for m in moves])
    ticks = float(style.word) if style.stream == "frames" else TICKS
    slower = 1.0
    for _ in range(400):  # tries at a longer time each, for a stretch in frames
        count = np.maximum(1.0, np.ceil(slower * planned * ticks - 1e-6))
        cubics = Cubics.through_points(q, count / ticks)
        ramps = np.sqrt((cubics.largest_acceleration() / limit).max())
        excess = max(float(ramps), float((cubics.peak_speed_ratio() * shortest / cubics.seconds).max()))
        if excess <= 1.0:
            break
        slower *= max(excess, 1.01)  # times slower at least
    else:
        raise InputError(f"frames at {ticks:g} a second cannot carry a path of {len(planned)} steps within the limits")
    frames = cubics.points_inside(count.astype(int)) if style.stream == "frames" else [()] * len(planned)
    return [
        TimedLeg(float(t), tuple(v), inner)
        for t, v, inner in zip(cubics.seconds, cubics.velocity[1:].tolist(), frames, strict=True)
    ]


@dataclass(frozen=True)
class Cubics:
    """Cubics one after the other: points q (n + 1, N), velocities there (n + 1, N), times of the legs (n,) [s]."""

    q: Array
    velocity: Array
    seconds: Array

    @classmethod
    def through_points(cls, q: Array, seconds: Array) -> "Cubics":
        """Return cubics through the points, from rest to rest.

        The velocity at a point is that of the parabola through it and its two neighbours.
        """
        mean, velocity = np.diff(q, axis=0) / seconds[:, None], np.zeros_like(q)
        before, after = seconds[:-1, None], seconds[1:, None]
        velocity[1:-1] = (after * mean[:-1] + before * mean[1:]) / (before + after)
        return cls(q, velocity, seconds)

    @property
    def mean(self) -> Array:
        """Return the mean velocity of each segment, (n, N)."""
        return np.asarray(np.diff(self.q, axis=0) / self.seconds[:, None])

    def largest_acceleration(self) -> Array:
        """Return the largest |acceleration| on each leg (n, N): that of a cubic is largest at one of its ends."""
        v0, v1, mean, h = self.velocity[:-1], self.velocity[1:], self.mean, self.seconds[:, None]
        begin, end = 6.0 * mean - 4.0 * v0 - 2.0 * v1, -6.0 * mean + 2.0 * v0 + 4.0 * v1
        return np.asarray(np.maximum(np.abs(begin), np.abs(end)) / h)

    def peak_speed_ratio(self) -> Array:
        """Return by how much the joint that moves furthest on a leg is faster than its mean at most (n,)."""
        v0, v1, mean = self.velocity[:-1], self.velocity[1:], self.mean
        u = PARTS
        speed = np.abs(6.0 * u * (1.0 - u) * mean + (1.0 - 4.0 * u + 3.0 * u**2) * v0 + (3.0 * u**2 - 2.0 * u) * v1)
        leading = np.abs(mean).argmax(axis=1)
        leg = np.arange(len(mean))
        even = np.abs(mean)[leg, leading]
        return np.asarray(np.where(even > 0.0, speed.max(axis=0)[leg, leading] / np.where(even > 0.0, even, 1.0), 1.0))

    def points_inside(self, count: np.ndarray) -> list[tuple[tuple[float, ...], ...]]:
        """Return the points that cut each leg into ``count`` (n,) equal times, without its ends."""
        out = []
        for k, n in enumerate(count.tolist()):
            u = np.arange(1, n)[:, None] / n
            h = self.seconds[k]
            points = (
                (1.0 - u) ** 2 * (1.0 + 2.0 * u) * self.q[k]
                + u**2 * (3.0 - 2.0 * u) * self.q[k + 1]
                + h * u * (1.0 - u) ** 2 * self.velocity[k]
                - h * u**2 * (1.0 - u) * self.velocity[k + 1]
            )
            out.append(tuple(map(tuple, points.tolist())))
        return out
