"""Forward kinematics of a robot with all that its file says of it: geometry and effects."""

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from planner.common.errors import InputError
from planner.common.units import Array
from planner.documents.calibrated_robot import CalibratedRobot
from planner.kinematics.robot import Robot
from planner.kinematics.robot_reader import load_robot


def forward(robot: Robot | Path | str, q: ArrayLike, tool: ArrayLike | None = None) -> Array:
    """Return the pose of the flange, or of a tool, in the base, T_BF or T_BT (n, 4, 4) [m].

    The effects of the robot's file (compliance, gears, encoders, …) are in it as far as they hang on joint angles and
    loads. A warning names the others. ``load_robot(…).chain.forward`` is the geometry alone.

    Args:
        robot: a loaded robot, the path of its ``robot.toml``, or the name of a shipped one.
        q: controller angles, (N,) or (n, N) [rad]; of a joint that slides as :class:`planner.Robot` counts it.
        tool: T_FT (4, 4), or the tool's point p_FT (3,) [m]; the flange without it.

    Raises:
        InputError: the shapes do not fit, or an effect has a basis function that is unknown.

    Example:
        >>> import numpy as np
        >>> from planner import forward
        >>> forward("ur10", np.zeros(6)).shape
        (1, 4, 4)
    """
    loaded = robot if isinstance(robot, Robot) else load_robot(str(robot))
    angles = np.atleast_2d(np.asarray(q, dtype=float))
    if angles.ndim != 2 or angles.shape[1] != loaded.n_joints:
        raise InputError(f"q has the shape {np.shape(q)}, but {loaded.name} has {loaded.n_joints} joints: give (n, N)")
    model = CalibratedRobot(loaded)
    if said := model.sentence:
        warnings.warn(said, stacklevel=2)
    T_BF = np.broadcast_to(np.eye(4), (len(angles), 4, 4)).copy()
    T_BF[:, :3, 3], T_BF[:, :3, :3] = model.flange(angles)
    return T_BF if tool is None else np.asarray(T_BF @ _transform(np.asarray(tool, dtype=float)))


def _transform(tool: Array) -> Array:
    if tool.shape == (3,):
        T_FT = np.eye(4)
        T_FT[:3, 3] = tool
        return T_FT
    if tool.shape != (4, 4):
        raise InputError(f"tool has the shape {tool.shape}: a point (3,) [m] or a transform (4, 4) is needed")
    return tool
