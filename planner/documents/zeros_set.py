"""A calibrated robot after its joint zeros were set in the controller: what is left of its errors."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.common.errors import InputError
from planner.common.units import Array
from planner.documents.expected_error import ExpectedError
from planner.fit.axis_zeros import AxisZeros
from planner.kinematics.robot import Robot


def set_zeros(robot: Robot, known: ExpectedError | str, joints: Sequence[int]) -> tuple[Robot, ExpectedError | str]:
    """Return a calibrated robot, and what is known of its errors, after the zeros of some joints were set.

    Once the controller shows the true angle of an axis, what its zero was off is gone from the arm, and with it from
    the model: what is left is corrected by programs.

    Args:
        robot: the calibrated one, as its file has it.
        known: what is known of its errors, or why nothing is.
        joints: numbers of the axes whose zeros were set, from 1: by as much as the identification has stated.

    Raises:
        InputError: there is no such joint, or this robot's file has no zero that is off there.
    """
    shift = _zero_shift(robot, joints)
    rows = tuple(
        t if t.joint is None else replace(t, nominal=t.nominal - float(shift[t.joint])) for t in robot.transforms
    )
    left = replace(robot, transforms=rows, nominal_transforms=robot.nominal_robot.transforms)
    if isinstance(known, str):
        return left, known
    names = {t.name: t.joint for t in robot.transforms if t.joint is not None}
    before = [
        v + (float(shift[joint]) if (joint := names.get(p.name)) is not None else 0.0)
        for p, v in zip(known.file.parameters, known.file.nominal, strict=True)
    ]
    file = known.file.model_copy(update={"nominal": tuple(before)})
    return left, ExpectedError(file, left)


def _zero_shift(robot: Robot, joints: Sequence[int]) -> Array:
    """Return by how much the rows' angles shift as the zeros of joints are set, (N,) [rad]."""
    off = np.zeros(robot.n_joints)
    for now, nominal in zip(robot.transforms, robot.nominal_robot.transforms, strict=True):
        if now.joint is not None:
            off[now.joint] = now.nominal - nominal.nominal
    turn = AxisZeros.of(robot).turn
    zero = turn @ off
    for k in joints:
        if not 1 <= k <= robot.n_joints:
            raise InputError(f"zero set of axis {k}: {robot.name} has the axes 1 to {robot.n_joints}")
        if abs(zero[k - 1]) < 1e-12:  # [rad] a zero that is off by less is not off
            raise InputError(
                f"zero set of axis {k}: by {robot.path} its zero is not off, so that it cannot have been set by it"
            )
    chosen = np.zeros(robot.n_joints)
    which = [k - 1 for k in joints]
    chosen[which] = zero[which]
    return np.asarray(np.linalg.solve(turn, chosen), dtype=float)
