"""Kinematics of six-axis arms from a robot file, with numpy alone: nothing of it is taken from the planner."""

import re
import tomllib
from dataclasses import dataclass

import numpy as np


def turn(axis, angle_deg):
    """The rotation matrix about x, y or z."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[j, i], matrix[i, j] = s, -s
    return matrix


def place(rotation=None, at_mm=(0, 0, 0)):
    """The 4 x 4 matrix of a rotation and a place."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.eye(3) if rotation is None else rotation
    matrix[:3, 3] = at_mm
    return matrix


def pose_of_angles(numbers):
    """X, Y, Z and turns about Z, Y', X" as KRL writes them (FANUC's R, P, W)."""
    x, y, z, a, b, c = numbers
    return place(turn("z", a) @ turn("y", b) @ turn("x", c), (x, y, z))


def pose_of_quaternion(numbers):
    """X, Y, Z and a quaternion, its scalar first, as RAPID writes them."""
    quaternion = np.asarray(numbers[3:], float)
    w, v = quaternion[0] / np.linalg.norm(quaternion), quaternion[1:] / np.linalg.norm(quaternion)
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return place(np.eye(3) + 2 * w * cross + 2 * cross @ cross, numbers[:3])


def angle_deg(first, second):
    """The angle between two poses' orientations; exact for small ones too."""
    difference = np.linalg.norm(first[:3, :3] - second[:3, :3]) / (2 * np.sqrt(2))
    return float(np.degrees(2 * np.arcsin(min(1.0, difference))))


@dataclass(frozen=True)
class Arm:
    """A six-axis arm: rows of DH parameters, the flange, and how the controller's axes follow from the joints."""

    modified: bool
    rows: list
    flange: np.ndarray
    axes_of_joints: np.ndarray

    def stand(self, axes_deg):
        """The pose of the flange at the controller's axis angles."""
        joints_deg = np.linalg.solve(self.axes_of_joints, np.asarray(axes_deg, float))
        pose = np.eye(4)
        for row, joint_deg in zip(self.rows, joints_deg, strict=True):
            along = place(turn("x", row["alpha_deg"]), (row["a_mm"], 0, 0))
            theta_deg = row["theta_deg"] + row["sense"] * (joint_deg - row["zero_deg"])
            about = place(turn("z", theta_deg), (0, 0, row["d_mm"]))
            if self.modified:
                pose = pose @ along @ place(turn("y", row.get("beta_deg", 0.0))) @ about
            else:
                pose = pose @ about @ along
        return pose @ self.flange

    def axes_at(self, pose, near_deg):
        """The axis angles at which the flange stands in a pose, by Newton's method from angles nearby."""
        axes = np.array(near_deg, float)
        for _ in range(60):
            error = _twist(self.stand(axes), pose)
            if np.linalg.norm(error) < 1e-10:
                return axes
            step = 1e-4
            moved = [(axes + step * unit, axes - step * unit) for unit in np.eye(6)]
            columns = [(_twist(self.stand(a), pose) - _twist(self.stand(b), pose)) / (2 * step) for a, b in moved]
            change = -np.linalg.lstsq(np.array(columns).T, error, rcond=1e-9)[0]
            axes = axes + change * min(1.0, 15 / max(np.abs(change).max(), 1e-9))
        raise ValueError(f"no axis angles near {near_deg}")


def _twist(here, there):
    """What is left from one pose to another; 300 mm weigh as much as a radian."""
    rotation = there[:3, :3] @ here[:3, :3].T
    about = [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    return np.r_[(there - here)[:3, 3] / 300, np.array(about) / 2]


def arm_of(path, nominal):
    """The arm of a calibrated robot file: as it is, or as its controller believes it to be."""
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    modified = table["convention"] == "mdh"
    rows = [dict(row) for row in table["joints"]]
    for key, value in table["nominal"].items() if nominal else ():
        name, index, unit = re.fullmatch(r"([a-z]+)(\d)_(\w+)", key).groups()
        rows[int(index) - 1 + _later(modified, name)][f"{name}_{unit}"] = value
    roll, pitch, yaw = table["flange"]["rpy_deg"]
    flange = place(turn("z", yaw) @ turn("y", pitch) @ turn("x", roll), table["flange"]["position_mm"])
    axes = np.eye(6)
    for controller in table["controllers"].values():
        for axis, joint, factor in controller.get("coupling", ()):
            axes[axis - 1, joint - 1] = factor
    return Arm(modified, rows, flange, axes)


def calibrated(text, changes):
    """The text of a calibrated robot file: a nominal one with other lengths and angles, and the controller's own."""
    head, *joints = re.split(r"(?m)^(?=\[\[joints\]\])", text)
    modified, nominal = '"mdh"' in head, []
    for key, change in changes.items():
        name, index, unit = re.fullmatch(r"([a-z]+)(\d)_(\w+)", key).groups()
        row = int(index) - 1 + _later(modified, name)
        found = re.search(rf"(?m)^{name}_{unit} = (\S+)", joints[row])
        value = float(found[1]) if found else 0.0
        joints[row] = re.sub(rf"(?m)^{name}_{unit} = .*\n", "", joints[row])
        joints[row] = joints[row].replace("sense = ", f"{name}_{unit} = {value + change!r}\nsense = ", 1)
        nominal.append(f"{key} = {value!r}")
    return "\n".join([head + "".join(joints), "[nominal]", *nominal, ""])


def _later(modified, name):
    """Modified DH counts alpha and a from 0: row i holds alpha_(i-1)."""
    return 1 if modified and name in ("alpha", "a", "beta") else 0
