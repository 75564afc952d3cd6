"""Alternatives that a residual is tested for: columns by which each quantity of the samples would enter the reading.

A quantity enters through a joint's angle (Jacobian column times a function of the quantity) and as an error of the
reading itself.
"""

from collections.abc import Iterator

import numpy as np

from planner.common.units import Array
from planner.fit.problem import FitProblem

CONDITIONS = ("temperature", "payload", "force")


def joint_columns(problem: FitProblem, detail: int) -> Iterator[tuple[str, Array]]:
    """Yield the first ``detail`` harmonics of each joint's angle, in angle and reading: columns (m, r, k)."""
    screws, each = _joint_rows(problem), _reading_rows(problem)
    for j, q in enumerate(problem.samples.q.T):
        angles = np.arange(1, detail + 1) * q[:, None]
        waves = np.concatenate([np.cos(angles), np.sin(angles)], axis=1)
        if np.ptp(q) > 0:
            yield f"joint {j + 1}", _joint_and_reading(waves, screws[:, :, [j]], each)


def alternative_columns(problem: FitProblem, detail: int) -> Iterator[tuple[str, Array]]:
    """Yield all other quantities that the samples have, columns (m, r, k)."""
    yield from _load_alternatives(problem, detail)
    yield from _direction_alternatives(problem)
    yield from _gauge_alternatives(problem, detail)
    yield from _condition_alternatives(problem, detail)


def _load_alternatives(problem: FitProblem, detail: int) -> Iterator[tuple[str, Array]]:
    """Loads by weight and pull as the robot's file knows them, and torques as measured."""
    screws, each, s = _joint_rows(problem), _reading_rows(problem), problem.samples
    kinds = [("load on joint", problem.context.load_torque)]
    kinds += [] if s.torque is None else [("measured torque of joint", s.torque)]
    for name, torques in kinds:
        for j, torque in enumerate(torques.T):
            if np.ptp(torque) > 1e-9 * max(1.0, float(np.abs(torque).max())):
                curves = _powers(torque, min(detail, 2))
                sign = np.sign(torque)[:, None]
                if detail > 1 and np.ptp(sign) > 0:
                    curves = np.concatenate([curves, sign], axis=1)
                yield f"{name} {j + 1}", _joint_and_reading(curves, screws[:, :, [j]], each)


def _direction_alternatives(problem: FitProblem) -> Iterator[tuple[str, Array]]:
    """Yield senses of motion and approach of each joint, and the difference of commanded and read angles."""
    screws, each, s = _joint_rows(problem), _reading_rows(problem), problem.samples
    for name, values in (("speed sign of joint", s.speed), ("approach of joint", s.direction)):
        for j, value in enumerate(np.zeros((0, len(s))) if values is None else values.T):
            sign = np.sign(value)[:, None]
            if np.ptp(sign) > 0:
                yield f"{name} {j + 1}", _joint_and_reading(sign, screws[:, :, [j]], each)
    if s.q_cmd is not None and s.q_read is not None:
        gap = s.q_cmd - s.q_read
        moved = np.flatnonzero(np.ptp(gap, axis=0) > 0)
        if len(moved):
            yield "commanded less read angles", screws[:, :, moved] * gap[:, None, moved]


def _gauge_alternatives(problem: FitProblem, detail: int) -> Iterator[tuple[str, Array]]:
    """Yield what the gauge reads: length and direction of a bar, else the position.

    On the nominal setup: what was read carries the very noise that is looked at.
    """
    each, c = _reading_rows(problem), problem.context
    for name, values in c.measurement_setup.gauge.coordinates(c.measurement_setup, c.samples, c.motion):
        columns = _powers(values, detail) if values.ndim == 1 else _surface(values, detail)
        yield name, _outer_columns(columns, each)


def _condition_alternatives(problem: FitProblem, detail: int) -> Iterator[tuple[str, Array]]:
    """Clock, sessions, temperature, payload and force, in the reading and in all joints."""
    screws, each, s = _joint_rows(problem), _reading_rows(problem), problem.samples
    whole = np.concatenate([np.broadcast_to(each, (len(s), *each.shape[1:])), screws], axis=2)
    for name in ("t", *CONDITIONS):
        values = getattr(s, name)
        if values is not None and np.ptp(values) > 0:
            yield (
                "time" if name == "t" else name,
                _outer_columns(_powers(values, detail), whole if detail > 1 else each),
            )
    if s.session is not None and np.ptp(s.session) > 0:
        labels = np.unique(s.session)
        flags = (s.session[:, None] == labels[1:]).astype(float)
        # 3: sessions up to which each may have joint offsets of its own
        yield "session", _outer_columns(flags, whole if detail > 1 and len(labels) <= 3 else each)


def _joint_rows(problem: FitProblem) -> Array:
    """Change of the reading by each joint's angle, (m, r, N)."""
    return problem.model.joint_rows(problem.samples)


def _reading_rows(problem: FitProblem) -> Array:
    """Every number of the reading by itself, (1, r, r)."""
    return np.eye(problem.model.width)[None]


def _joint_and_reading(curves: Array, screw: Array, each: Array) -> Array:
    return np.concatenate([_outer_columns(curves, screw), _outer_columns(curves, each)], axis=2)


def _outer_columns(curves: Array, through: Array) -> Array:
    """Every curve (m, w) through every column (m or 1, r, k): (m, r, w·k)."""
    m = len(curves)
    return np.asarray((curves[:, None, :, None] * through[:, :, None, :]).reshape(m, through.shape[1], -1))


def _powers(values: Array, highest: int) -> Array:
    """Powers 1 … ``highest`` of values brought to −1 … 1, (m, highest)."""
    x = 2 * (values - values.min()) / max(float(np.ptp(values)), 1e-300) - 1
    return np.asarray(x[:, None] ** np.arange(1, highest + 1))


def _surface(points: Array, detail: int) -> Array:
    """Straight, and with more detail quadratic, functions of points (m, 3), brought to −1 … 1."""
    x = np.stack([_powers(v, 1)[:, 0] for v in points.T], axis=1)
    if detail < 2:
        return x
    return np.concatenate([x, *(x[:, [i]] * x[:, i:] for i in range(3))], axis=1)
