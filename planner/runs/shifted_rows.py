"""Readings that stand a row beside the angles that they belong to: found where the robot is known."""

from __future__ import annotations

import numpy as np

from planner.common.errors import InputError
from planner.common.units import Array, to_mm
from planner.kinematics.robot import Robot
from planner.runs.run import Run


def refuse_shifted_rows(run: Run, robot: Robot) -> None:
    """Refuse a run whose readings fit the nominal robot much better a row or more away.

    Wherever gauge and target are, a position is linear in the flange's position and orientation, and the square of a
    length in them and in the position seen from the flange. So the fit needs neither.

    Raises:
        InputError: with the shift, and the errors with and without it.
    """
    most_shift = 3  # [rows] that are tried to either side
    more_rows = 2  # rows an unknown of the fit, from which on rows beside each other fit by chance no more
    sure = 0.2  # of the error as the rows stand: what a shift leaves where it is the right one
    readings = run.readings.position if run.readings.position is not None else run.readings.length
    one = len(run.places) == 1 and len(run.points) == 1
    if readings is None or run.continuous or not one or run.samples.q.shape[1] != robot.n_joints:
        return
    y = readings if readings.ndim == 2 else readings[:, None] ** 2
    A = _unknowns(robot, run.samples.q, readings.ndim == 1)
    if len(y) < more_rows * A.shape[1] + most_shift:
        return
    errors = {shift: _error(A, y, shift) for shift in range(-most_shift, most_shift + 1)}
    if readings.ndim == 1:  # of a square, the error of a length is half of it by the length
        errors = {shift: e / (2 * float(readings.mean())) for shift, e in errors.items()}
    best = min(errors, key=lambda shift: errors[shift])
    if best and errors[best] < sure * errors[0]:
        rows, side = f"{abs(best)} row{'s' * (abs(best) > 1)}", "below" if best > 0 else "above"
        raise InputError(
            f"{run.name}: each reading belongs to the angles of another row: those {rows} {side} fit {robot.name} to "
            f"{to_mm(errors[best]):.2g} mm, those of the same row to {to_mm(errors[0]):.2g} mm; one log has begun "
            f"{rows} {'earlier' if best > 0 else 'later'} than the other: take out its first rows, and the last ones "
            "of the other"
        )


def _unknowns(robot: Robot, q: Array, squares: bool) -> Array:
    """Return what readings at angles (n, N) are linear in, (n, k)."""
    stand = robot.chain.forward(robot.theta(q))
    p, R = stand.x.T, np.moveaxis(stand.R, 2, 0)
    columns = [np.ones((len(q), 1)), p, R.reshape(len(q), 9)]
    if squares:
        columns += [np.einsum("nij,ni->nj", R, p), (p**2).sum(axis=1)[:, None]]
    return np.column_stack(columns)


def _error(A: Array, y: Array, shift: int) -> float:
    """Return the root mean square of what a fit leaves of readings that stand ``shift`` rows below their angles."""
    n = len(y) - abs(shift)
    A, y = A[max(-shift, 0) :][:n], y[max(shift, 0) :][:n]
    solution, _, rank, _ = np.linalg.lstsq(A, y)
    return float(np.sqrt(((y - A @ solution) ** 2).sum() / max((n - int(rank)) * y.shape[1], 1)))
