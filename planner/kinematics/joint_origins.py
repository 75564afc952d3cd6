"""A chain of rows as joint origins between turns about z, in the forms that ROS and the drivers of UR robots read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np

from planner.common.lazy_modules import LazyModule
from planner.kinematics.chain import Transform
from planner.kinematics.robot import Robot, elementary_placement

if TYPE_CHECKING:
    import pinocchio as pin
else:
    pin = LazyModule("pinocchio")

UR_LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
BEHIND = 1e-7  # [m, rad] of a transform behind the last joint that such a file has no place for


def joint_origins(robot: Robot, values: Mapping[str, float]) -> tuple[list[pin.SE3], pin.SE3]:
    """Return the frame of each joint in that of the joint before, at controller angle zero, and the flange in the last.

    A shift along a joint's own axis stands before its turn, as URDF files have it. ``values`` are corrected values of
    elementary transforms [m, rad]; the joints of the robot turn about z of their rows (DH and MDH).
    """
    origins: list[pin.SE3] = []
    T = pin.SE3.Identity()
    after_turn = False  # what commutes with the turn that has just been passed
    for t in robot.transforms:
        step = elementary_placement(t, values.get(t.name, t.nominal) + _zero(robot, t))
        if after_turn and t.axis == 2:
            origins[-1] = origins[-1] * step
            continue
        T, after_turn = T * step, t.joint is not None
        if after_turn:
            origins.append(T)
            T = pin.SE3.Identity()
    return origins, T


def _zero(robot: Robot, t: Transform) -> float:
    return 0.0 if t.joint is None else float(robot.theta_zero[t.joint])


def exported_models(robot: Robot, values: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    """Yield name and text of the models that other software reads, of a robot of DH or MDH rows without coupled axes.

    ``robot.urdf`` where the joints have names, ``calibration.yaml`` of ur_description for the robots of UR.
    """
    sense = np.diag(robot.sense_matrix)
    if robot.convention == "urdf" or not np.array_equal(np.diag(sense), robot.sense_matrix):
        return
    if robot.joint_names:
        yield "robot.urdf", _urdf(robot, values, sense)
    if robot.dialect == "urscript" and robot.n_joints == len(UR_LINKS) and (sense == 1.0).all():
        yield "calibration.yaml", _ur_calibration(robot, values)


def _urdf(robot: Robot, values: Mapping[str, float], sense: np.ndarray) -> str:
    origins, flange = joint_origins(robot, values)
    n = robot.n_joints
    links = ["base_link", *(f"link_{i}" for i in range(1, n + 1)), "flange"]
    lines = ['<?xml version="1.0"?>', f"<robot name={quoteattr(robot.name)}>"]
    lines += [f'  <link name="{name}"/>' for name in links]
    for i, (name, T) in enumerate(zip(robot.joint_names, origins, strict=True)):
        lines += [
            f'  <joint name={quoteattr(name)} type="revolute">',
            *_between(links[i], links[i + 1], T),
            f'    <axis xyz="0 0 {sense[i]:g}"/>',
            f'    <limit lower="{robot.q_lower[i]:.9g}" upper="{robot.q_upper[i]:.9g}" '
            f'velocity="{robot.speed[i]:.9g}" effort="0"/>',
            "  </joint>",
        ]
    lines += ['  <joint name="flange_joint" type="fixed">', *_between(links[n], "flange", flange), "  </joint>"]
    return "\n".join([*lines, "</robot>", ""])


def _between(parent: str, child: str, T: pin.SE3) -> list[str]:
    xyz, rpy = (" ".join(f"{v + 0.0:.12g}" for v in np.round(part, 13)) for part in _pose(T))
    return [f'    <parent link="{parent}"/>', f'    <child link="{child}"/>', f'    <origin xyz="{xyz}" rpy="{rpy}"/>']


def _pose(T: pin.SE3) -> tuple[np.ndarray, np.ndarray]:
    return np.asarray(T.translation), np.asarray(pin.rpy.matrixToRpy(T.rotation))


def _ur_calibration(robot: Robot, values: Mapping[str, float]) -> str:
    """The file that ``kinematics_params_file`` of ur_robot_driver takes; keys as in ur_description's own."""
    origins, behind = joint_origins(robot, values)
    lines = [
        "# For kinematics_params_file of ur_description. The hash is not the robot's: its driver says that the robot's",
        "# own calibration is another, which is right.",
    ]
    off = np.abs(np.concatenate([behind.translation, pin.log3(behind.rotation)]))
    if off.max() > BEHIND:
        lines.append(
            "# Behind the last joint more was found, which this file has no place for: it belongs to the tool:"
        )
        lines.append("# " + " ".join(f"{v:.9g}" for part in _pose(behind) for v in part) + " (xyz in m, rpy in rad)")
    lines.append("kinematics:")
    for name, T in zip(UR_LINKS, origins, strict=True):
        numbers = np.round(np.concatenate(_pose(T)), 13) + 0.0
        lines.append(f"  {name}:")
        lines += [
            f"    {k}: {v!r}" for k, v in zip(("x", "y", "z", "roll", "pitch", "yaw"), numbers.tolist(), strict=True)
        ]
    return "\n".join([*lines, "  hash: calib_edbb", ""])
