"""A robot in its cell as a sequence of elementary transforms, batched over samples; DH, modified DH and URDF rows
become such sequences."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from planner.common.units import Array, read_only

Kind = Literal["translation", "rotation"]


@dataclass(frozen=True)
class Transform:
    """One elementary transform.

    Attributes:
        name: the field's name of its parameter, for instance ``a2`` or ``map_z``.
        kind: ``translation`` [m] or ``rotation`` [rad].
        axis: 0, 1 or 2 for x, y or z.
        nominal: constant part of its value, m or rad.
        joint: index of the joint whose variable is added to the value, or ``None``.
        fixed: whether it has no error of its own, because other transforms have it.
        travel: of a joint that slides, how far its variable is from 0 at most [m].
    """

    name: str
    kind: Kind
    axis: int
    nominal: float
    joint: int | None = None
    fixed: bool = False
    travel: float = 0.0

    @property
    def extent(self) -> float:
        """The longest that a translation can be [m], whatever its joint does."""
        return abs(self.nominal) + self.travel


@dataclass(frozen=True)
class ForwardPass:
    """Where the measured point is, and the screw of every elementary transform.

    Attributes:
        x: measured point in the base frame, (3, n) [m].
        R: orientation of the last frame in the base frame, (3, 3, n).
        u: direction of each transform's axis in the base frame, (K, 3, n).
        p: a point on each transform's axis, (K, 3, n) [m].
        rotation: which transforms are rotations, (K,) bool.
    """

    x: Array
    R: Array
    u: Array
    p: Array
    rotation: np.ndarray

    def turns(self, which: np.ndarray) -> Array:
        """Angular velocity per unit of the transforms at ``which``, (k, 3, n): none of a translation."""
        return np.asarray(self.u[which] * self.rotation[which, None, None])

    def point_screws(self, which: np.ndarray | None = None) -> Array:
        """Velocity of the measured point per unit of each transform's value, (K, 3, n), or of those at ``which``."""
        every = slice(None) if which is None else which
        turns = self.rotation[every]
        dx = self.u[every].copy()
        r = self.x[None] - self.p[every][turns]
        u = dx[turns]
        dx[turns] = np.stack(
            [
                u[:, 1] * r[:, 2] - u[:, 2] * r[:, 1],
                u[:, 2] * r[:, 0] - u[:, 0] * r[:, 2],
                u[:, 0] * r[:, 1] - u[:, 1] * r[:, 0],
            ],
            axis=1,
        )
        return dx


@dataclass(frozen=True)
class Chain:
    """Elementary transforms from the base to the measured point.

    Values are ``nominal + theta[joint] + delta``. The variables theta are those of the kinematic rows, in rad, or in m
    where a joint slides, and not the controller's.
    """

    transforms: tuple[Transform, ...]

    def __len__(self) -> int:
        """Return the number of elementary transforms K."""
        return len(self.transforms)

    @cached_property
    def joint_places(self) -> NDArray[np.intp]:
        """Position among the transforms of each joint's, in the joints' order."""
        return np.array(
            [k for _, k in sorted((t.joint, k) for k, t in enumerate(self.transforms) if t.joint is not None)]
        )

    @cached_property
    def _nominal_transforms(self) -> list[Array]:
        return [read_only([t.nominal]) for t in self.transforms]

    def index(self, name: str) -> int:
        """Return the position of the transform called ``name``."""
        return [t.name for t in self.transforms].index(name)

    def values(self, theta: Array, delta: Sequence[float | Array] | Array | None = None) -> list[Array]:
        """Return the value of each transform, each of shape (1,) or (n,) [m or rad].

        Args:
            theta: joint angles of the kinematic rows, (n, N) [rad].
            delta: what is added to each transform, K numbers or (n,) arrays [m or rad].
        """
        out = []
        for k, t in enumerate(self.transforms):
            value = self._nominal_transforms[k] if t.joint is None else t.nominal + theta[:, t.joint]
            out.append(value if delta is None else np.atleast_1d(value + delta[k]))
        return out

    def forward(self, theta: Array, delta: Sequence[float | Array] | Array | None = None) -> ForwardPass:
        """Run the batched forward pass over ``theta`` (n, N) [rad]; see :meth:`values` for ``delta``."""
        n, K = len(theta), len(self)
        u, p = np.empty((K, 3, n)), np.empty((K, 3, n))
        for k, (R, x) in enumerate(self._walk(self.values(theta, delta))):
            if k < K:
                u[k], p[k] = R[:, self.transforms[k].axis], x
        rotation = np.array([t.kind == "rotation" for t in self.transforms])
        return ForwardPass(np.broadcast_to(x, (3, n)), np.broadcast_to(R, (3, 3, n)), u, p, rotation)

    def frames(self, theta: Array, ends: Sequence[int]) -> list[tuple[Array, Array]]:
        """Return orientation (3, 3, m) and origin (3, m) [m] of the frames after the first ``ends`` transforms.

        ``ends`` ascend; ``theta`` (n, N) [rad]; m is n, or 1 for a frame that no joint moves.
        """
        return [frame for k, frame in enumerate(self._walk(self.values(theta))) for end in ends if k == end]

    def _walk(self, values: Sequence[Array]) -> Iterator[tuple[Array, Array]]:
        """Yield orientation (3, 3, m) and origin (3, m) [m] before each transform, and after the last."""
        R, x = np.eye(3)[:, :, None], np.zeros((3, 1))
        for t, value in zip(self.transforms, values, strict=True):
            yield R, x
            if t.kind == "translation":
                x = x + R[:, t.axis] * value
            elif value.size != 1 or value[0] != 0.0:
                R = _rotate(R, t.axis, value)
        yield R, x

    def carry(self, theta: Array, v: Array, point: bool = True) -> Array:
        """Carry one point (or, with ``point=False``, one direction) of the last frame to the base frame.

        Cheaper than the forward pass: only three numbers a sample travel down the chain.

        Args:
            theta: joint angles of the kinematic rows, (n, N) [rad].
            v: the point or direction in the last frame, (3,) [m or 1].
            point: whether translations act on it.

        Returns:
            (n, 3) [m or 1].
        """
        w = [np.full(1, float(c)) for c in v]
        for t, value in zip(reversed(self.transforms), reversed(self.values(theta)), strict=True):
            if t.kind == "translation":
                if point:
                    w[t.axis] = w[t.axis] + value
            elif value.size != 1 or value[0] != 0.0:
                b, c = (t.axis + 1) % 3, (t.axis + 2) % 3
                cos, sin = np.cos(value), np.sin(value)
                w[b], w[c] = cos * w[b] - sin * w[c], sin * w[b] + cos * w[c]
        return np.stack([np.broadcast_to(c, (len(theta),)) for c in w], axis=1)


def _rotate(R: Array, axis: int, angle: Array) -> Array:
    """Multiply the rotations R (3, 3, m) from the right by a rotation about ``axis``."""
    b, c = (axis + 1) % 3, (axis + 2) % 3
    cos, sin = np.cos(angle), np.sin(angle)
    out = np.empty((3, 3, max(R.shape[2], angle.size)))
    out[:, axis] = R[:, axis]
    out[:, b] = cos * R[:, b] + sin * R[:, c]
    out[:, c] = cos * R[:, c] - sin * R[:, b]
    return out


ROWS = {  # Hayati's β only where it is given; θ is the joint's
    "dh": ("theta", "d", "a", "alpha", "beta"),  # Rz(θ) Tz(d) Tx(a) Rx(α) Ry(β)
    "mdh": ("alpha", "a", "beta", "theta", "d"),  # Rx(α) Tx(a) Ry(β) Rz(θ) Tz(d) (TriCal, Table 4)
}
ROW_MOVES = {"theta": "Rz", "d": "Tz", "a": "Tx", "alpha": "Rx", "beta": "Ry"}
KINDS: dict[str, Kind] = {"R": "rotation", "T": "translation"}


def dh_row(convention: str, i: int, values: Mapping[str, float], variable: str = "theta") -> list[Transform]:
    """Return the transforms of row i (from 1) in standard (``dh``) or modified DH (``mdh``), values in m and rad.

    ``variable``: what of the row the joint moves, ``theta``, or ``d`` where it slides.
    """
    row = []
    for key in (key for key in ROWS[convention] if key in values):
        move = ROW_MOVES[key]
        name, joint = f"{key}{i - is_of_link_before(convention, key)}", i - 1 if key == variable else None
        row.append(Transform(name, KINDS[move[0]], "xyz".index(move[1]), values[key], joint))
    return row


def is_of_link_before(convention: str, key: str) -> bool:
    """Tell whether a parameter of row i has the index i − 1: α, a and β of modified DH."""
    return convention == "mdh" and key in ("alpha", "a", "beta")


def is_near_parallel(convention: str, i: int, n: int, alpha: float) -> bool:
    """Tell whether row i of n joins near-parallel axes, so that DH alone cannot say that they are skew."""
    parallel_angle = np.deg2rad(5.0)  # neighbouring axes closer than this get Hayati's parameter [rad]
    joins_axes = i < n if convention == "dh" else i > 1
    return joins_axes and abs(np.sin(alpha)) < np.sin(parallel_angle)


def xyz_transforms(
    name: str, kind: Kind, values: Sequence[float] | Array = (0.0, 0.0, 0.0), suffix: str = "", fixed: bool = False
) -> list[Transform]:
    """Return three transforms along or about x, y and z [m or rad], each called after its axis."""
    return [Transform(f"{name}{'xyz'[k]}{suffix}", kind, k, float(values[k]), fixed=fixed) for k in range(3)]


def frame_transforms(suffix: str, xyz: np.ndarray, rpy: np.ndarray) -> list[Transform]:
    """A frame without errors of its own: Tx Ty Tz Rz(yaw) Ry(pitch) Rx(roll), the URDF origin [m, rad]."""
    return xyz_transforms("", "translation", xyz, suffix, fixed=True) + fixed_turns("r", suffix, rpy)


def fixed_turns(name: str, suffix: str, rpy: np.ndarray) -> list[Transform]:
    """Rz(yaw) Ry(pitch) Rx(roll) without errors of their own."""
    return xyz_transforms(name, "rotation", rpy, suffix, fixed=True)[::-1]


def frame_with_errors(suffix: str, xyz: np.ndarray, rpy: np.ndarray) -> list[Transform]:
    """A URDF origin and its errors: Tx Ty Tz, the fixed turns, then small turns about x, y and z [m, rad].

    The errors turn about the axes of the frame itself, where they are zero, so that none is lost at a pitch of ±90°.
    """
    moves, errors = xyz_transforms("", "translation", xyz, suffix), xyz_transforms("r", "rotation", suffix=suffix)
    return [*moves, *fixed_turns("origin_r", suffix, rpy), *errors]
