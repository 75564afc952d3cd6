"""Which way the arm goes as a coupled axis of its controller is jogged alone, for a person to see at the robot."""

from collections.abc import Iterator

import numpy as np

from planner.common.units import DEG, Array
from planner.kinematics.axes import AxisConvention
from planner.kinematics.geometry import log3
from planner.kinematics.robot import Robot


def coupling_checks(robot: Robot, axes: AxisConvention, names: tuple[str, ...], q: Array) -> Iterator[str]:
    """Yield, for every axis that others count with, what is to be seen as it alone is jogged.

    A sentence says how far the link behind each of those others turns in the room. A link that turns further than the
    axis that is jogged is what no arm does: the factor has the wrong sign then.

    Args:
        robot: whose joints ``axes`` are told by.
        axes: how the controller counts.
        names: of the controller's axes.
        q: where the arm stands at the start, (N,) [rad].
    """
    if not axes.is_coupled:
        return
    jog = 10.0 * DEG  # far enough to be seen, and near enough to be safe
    too_far = 1.5  # a link by the jogged turn: 1.42 at most where the axes are square to each other, 2 by a wrong sign
    order = np.argsort(robot.slides, kind="stable")  # joint of each axis of the controller: those that turn come first
    for jogged in range(axes.n_axes):
        turn = jog * axes.inverse[:, jogged]
        moved = [j for j in np.flatnonzero(np.abs(turn) > 1e-9).tolist() if not robot.slides[j]]
        own = int(order[jogged])
        for last in (j for j in moved if j != own):
            partial = np.where(np.arange(axes.n_axes) <= max(last, own), turn, 0.0)
            in_room = _turn_of_flange(robot, q, partial)
            said = (
                f"check at the robot: {names[jogged]} jogged by +{jog / DEG:g} deg alone turns joint {own + 1} by "
                f"{turn[own] / DEG:+g} and joint {last + 1} by {turn[last] / DEG:+.6g} deg, and the link behind joint "
                f"{last + 1} {_in_room(in_room)}; where it goes another way, do not start: coupling in robot.toml is "
                "wrong"
            )
            doubt = "; this factor turns it much further than the axis itself: its sign is likely wrong"
            yield said + (doubt if in_room > too_far * abs(turn[own]) else "")


def _turn_of_flange(robot: Robot, q: Array, turn: Array) -> float:
    """Return by how much the flange turns in the room from q to q + turn, both (N,) [rad]."""
    R = robot.chain.forward(robot.theta(np.stack([q, q + turn]))).R
    return float(np.linalg.norm(log3((R[:, :, 1] @ R[:, :, 0].T)[None])[0]))


def _in_room(turn: float) -> str:
    """Say how far a link turns; robot files give angles to a thousandth of a degree."""
    return "keeps its direction in the room" if turn < 1e-3 * DEG else f"turns by {turn / DEG:.3g} deg in the room"
