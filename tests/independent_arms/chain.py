"""Forward kinematics and gravity of a serial arm, in numpy, for many states at once.

Frames: 0 is the base, k the frame behind the k-th DH row, 6 the flange. Axis i turns about z of frame i - 1.
A twist (dx, dy, dz, rx, ry, rz) in frame k moves all that comes behind it.
"""

import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

GRAVITY = 9.81
ROBOT = Path(__file__).parents[2] / "robots" / "comau-nj130" / "robot.toml"


@dataclass(frozen=True)
class Arm:
    """The DH table of an arm, in m and rad."""

    a: np.ndarray
    d: np.ndarray
    alpha: np.ndarray
    theta: np.ndarray
    low: np.ndarray
    high: np.ndarray


def read_arm(path=ROBOT):
    joints = tomllib.loads(Path(path).read_text(encoding="utf-8"))["joints"]
    column = {k: np.array([j[k] for j in joints], float) for k in ("a_mm", "d_mm", "alpha_deg", "theta_deg")}
    limit = np.radians([j["limit_deg"] for j in joints])
    return Arm(
        column["a_mm"] / 1e3, column["d_mm"] / 1e3, np.radians(column["alpha_deg"]), np.radians(column["theta_deg"]),
        limit[:, 0], limit[:, 1],
    )  # fmt: skip


def rotations(vectors):
    """Rotation matrices of rotation vectors (n, 3), by Rodrigues."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    k = np.stack([np.stack([zero, -z, y], -1), np.stack([z, zero, -x], -1), np.stack([-y, x, zero], -1)], -2)
    small = angle < 1e-9
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 1.0, np.sin(safe) / safe)
    second = np.where(small, 0.5, (1 - np.cos(safe)) / safe**2)
    return np.eye(3) + first * k + second * (k @ k)


def transforms(twists):
    """Homogeneous matrices (n, 4, 4) of twists (n, 6)."""
    out = np.zeros((*np.shape(twists)[:-1], 4, 4))
    out[..., :3, :3] = rotations(twists[..., 3:])
    out[..., :3, 3] = twists[..., :3]
    out[..., 3, 3] = 1.0
    return out


def dh_rows(arm, q):
    """The six matrices (6, n, 4, 4) Rz(theta) Tz(d) Tx(a) Rx(alpha) at joint angles q (n, 6)."""
    angle = (q + arm.theta).T
    c, s = np.cos(angle), np.sin(angle)
    ca, sa = np.cos(arm.alpha)[:, None], np.sin(arm.alpha)[:, None]
    out = np.zeros((6, len(q), 4, 4))
    out[..., 0, 0], out[..., 0, 1], out[..., 0, 2] = c, -s * ca, s * sa
    out[..., 1, 0], out[..., 1, 1], out[..., 1, 2] = s, c * ca, -c * sa
    out[..., 2, 1], out[..., 2, 2] = sa, ca
    out[..., 0, 3], out[..., 1, 3], out[..., 2, 3] = arm.a[:, None] * c, arm.a[:, None] * s, arm.d[:, None]
    out[..., 3, 3] = 1.0
    return out


def frames(arm, q, twists=None):
    """Frames 0 to 6 (7, n, 4, 4) in the base; ``twists`` (7, n, 6) act in them, each before the next row."""
    rows = dh_rows(arm, q)
    out = np.empty((7, len(q), 4, 4))
    bent = None if twists is None else transforms(twists)
    out[0] = np.eye(4) if bent is None else bent[0]
    for k in range(6):
        out[k + 1] = out[k] @ rows[k]
        if bent is not None:
            out[k + 1] = out[k + 1] @ bent[k + 1]
    return out


def points(frame, p):
    """Points (n, 3) of p (3,), given in frames (n, 4, 4)."""
    return frame[..., :3, :3] @ p + frame[..., :3, 3]


@dataclass(frozen=True)
class Masses:
    """Masses of links 1 to 6 and of the tool [kg], their centres [m] in the link's frame (tool: in the flange)."""

    kg: np.ndarray
    centre: np.ndarray


@dataclass(frozen=True)
class Loads:
    """What gravity does: moment and force of all that is behind each of frames 0 to 6, in that frame (7, n, 3)."""

    moment: np.ndarray
    force: np.ndarray

    def torque(self, joint):
        """Torque of gravity about axis ``joint`` (1 to 6)."""
        return self.moment[joint - 1, :, 2]


def loads(arm, masses, q):
    """Moments and forces of gravity, summed from the tool inwards."""
    frame = frames(arm, q)
    centre = np.stack([points(frame[min(k, 6)], masses.centre[k - 1]) for k in range(1, 8)])
    moment, force = np.zeros((7, len(q), 3)), np.zeros((7, len(q), 3))
    weight, first = 0.0, np.zeros((len(q), 3))
    for k in range(6, -1, -1):
        weight = weight + masses.kg[k]
        first = first + masses.kg[k] * centre[k]
        lever = first - weight * frame[k][:, :3, 3]
        down = np.array([0.0, 0.0, -GRAVITY])
        turn = frame[k][:, :3, :3]
        moment[k] = np.einsum("nji,nj->ni", turn, np.cross(lever, down))
        force[k] = np.einsum("nji,j->ni", turn, weight * down)
    return Loads(moment, force)
