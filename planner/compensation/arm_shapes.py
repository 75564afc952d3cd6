"""The eight shapes in which an arm with a spherical wrist reaches a pose, told apart by three signs.

Bit 0: the wrist's centre is behind axis 1. Bit 1: joint 3 is above the angle at which the arm is stretched.
Bit 2: joint 5 is negative. KUKA's status and RAPID's cfx count the same three signs.
"""

from dataclasses import dataclass

import numpy as np

from planner.common.units import DEG, QUARTER_TURN, Array
from planner.compensation.targets import CorrectedArm
from planner.compensation.tolerances import SHAPE_BORDER, WRIST_OFF
from planner.kinematics.robot import Robot
from planner.programs.languages.declared import ArmShape


def has_shapes(robot: Robot) -> bool:
    """Return whether the robot has six joints, axes 2 and 3 parallel, and a spherical wrist."""
    if robot.n_joints != 6:
        return False
    q = np.linspace(0.2, 0.7, 6)[None]
    p, u = _axes(robot, q)
    wrist = _wrist(p, u)
    off = np.linalg.norm(np.cross(wrist - p[3], u[3]), axis=-1)
    skew = np.linalg.norm(np.cross(u[1], u[2]), axis=-1)
    return bool(off[0] < WRIST_OFF and skew[0] < WRIST_OFF and abs(np.sum(u[4] * u[5])) < WRIST_OFF)


def shape_margins(robot: Robot, q: Array) -> Array:
    """Return how clearly each bit is 0 (positive) or 1 (negative), (n, 3) [m, m², rad], at q (n, 6) [rad]."""
    p, u = _axes(robot, q)
    wrist = _wrist(p, u)
    ahead = np.sum(np.cross(u[0], u[1]) * (wrist - p[0]), axis=-1)
    sense = np.sign(robot.coupling_matrix[2, 2])
    elbow = sense * np.sum(np.cross(p[2] - p[1], wrist - p[2]) * u[2], axis=-1)
    return np.column_stack([_forward(robot) * ahead, -elbow, q[:, 4]])


def _forward(robot: Robot) -> float:
    """Return on which side of axis 1 the wrist counts as in front, +1 or -1: where it is at 0 of all joints.

    Of an arm that stands upright there it is where joint 2 leans it as it turns up.
    """
    q = np.array([[0.0] * 6, [0.0, 0.5, 0.0, 0.0, 0.0, 0.0]])  # [rad]
    p, u = _axes(robot, q)
    ahead = np.sum(np.cross(u[0], u[1]) * (_wrist(p, u) - p[0]), axis=-1)
    return float(np.sign(ahead[0] if abs(ahead[0]) > SHAPE_BORDER else ahead[1]))


def shape_of(robot: Robot, q: Array) -> np.ndarray:
    """Return the number of the shape, 0 … 7, at q (n, 6) [rad], (n,) int."""
    return np.asarray((shape_margins(robot, q) < 0.0) @ np.array([1, 2, 4]))


def has_shape(robot: Robot, q: Array, shape: np.ndarray) -> np.ndarray:
    """Return whether q (n, 6) [rad] has the shape (n,), or stands at its border, (n,) bool."""
    bits = (np.asarray(shape)[:, None] >> np.arange(3)) & 1
    m = shape_margins(robot, q)
    return np.asarray(((np.abs(m) < SHAPE_BORDER) | ((m < 0.0) == (bits == 1))).all(axis=1))


def _axes(robot: Robot, q: Array) -> tuple[Array, Array]:
    """Return a point on every joint's axis and its direction, each (6, n, 3)."""
    motion = robot.chain.forward(robot.theta(q))
    order = robot.chain.joint_places
    return np.swapaxes(motion.p[order], 1, 2), np.swapaxes(motion.u[order], 1, 2)


def _wrist(p: Array, u: Array) -> Array:
    """Return the point of axis 5 that is nearest to axis 6, (n, 3) [m]; the two are perpendicular."""
    along = np.sum((p[5] - p[4]) * u[4], axis=-1, keepdims=True)
    return np.asarray(p[4] + along * u[4])


ACCURATE = 16  # status bit of a point that was taught on a robot with an accuracy model of its own
CONFIGURED = (0, 3, 5)  # joints whose quarter turns cf1, cf4, cf6 count


@dataclass(frozen=True)
class StatusTurn:
    """KUKA's status and turn: the shape of the arm, and a bit for each joint that is negative."""

    status: int
    turn: int

    @property
    def shape(self) -> int | None:
        """Number of the arm's shape: bits 0 and 1 are KUKA's own; the sign of A5 is taken from the turn.

        Manuals disagree on what status bit 2 means, and agree on the bits of the turn.
        """
        return (self.status & 3) | (self.turn >> 4 & 1) << 2

    def turns(self, q: Array) -> np.ndarray:
        """Return whether the joints q (n, N) [rad] have the signs that are said; near zero either will do."""
        negative = (self.turn >> np.arange(q.shape[1])) & 1
        return np.asarray((np.abs(q) < SHAPE_BORDER) | ((q < 0) == (negative == 1)))

    def correct_numbers(self, arm: CorrectedArm) -> tuple[int, ...]:
        """Return status and turn; a bit changes only where the corrected angle contradicts it."""
        wrist_bit = 4  # number of the status bit and of the joint of the wrist
        turn = update_bits(self.turn, arm.q, arm.q_slack)
        status = update_bits(self.status & 3, arm.margins[:2], arm.margins_slack[:2]) | self.status & ~3
        return status ^ (wrist_bit if (turn ^ self.turn) >> wrist_bit & 1 else 0), turn


def update_bits(bits: int, values: Array, slack: Array) -> int:
    """Return ``bits`` with bit i set where value i is negative, kept where it is zero but for ``slack``."""
    for i, value in enumerate(values):
        if abs(value) > slack[i]:
            bits = bits | 1 << i if value < 0 else bits & ~(1 << i)
    return bits


@dataclass(frozen=True)
class ConfData:
    """RAPID's confdata: quarter turns of joints 1, 4 and 6, and the shape of the arm."""

    quarters: tuple[int, int, int]
    cfx: int

    @property
    def shape(self) -> int | None:
        """Number of the arm's shape: cfx counts axis 1, lower arm (in front is 0) and joint 5 from its highest bit."""
        return (self.cfx >> 2) | ((~self.cfx >> 1 & 1) << 1) | (self.cfx & 1) << 2

    def turns(self, q: Array) -> np.ndarray:
        """Return whether joints 1, 4, 6 of q (n, 6) [rad] are in their quarters; at a border either will do."""
        fits = np.ones(q.shape, dtype=bool)
        for joint, quarter in zip(CONFIGURED, self.quarters, strict=True):
            fits[:, joint] = _in_quarter(q[:, joint], quarter, SHAPE_BORDER)
        return fits

    def correct_numbers(self, arm: CorrectedArm) -> tuple[int, ...]:
        """Return cf1, cf4, cf6, cfx; a number changes only where the corrected angle contradicts it."""
        quarters = [
            quarter if _in_quarter(arm.q[j], quarter, arm.q_slack[j]) else int(np.floor(arm.q[j] / QUARTER_TURN))
            for j, quarter in zip(CONFIGURED, self.quarters, strict=True)
        ]
        shape = update_bits(self.shape or 0, arm.margins, arm.margins_slack)
        return (*quarters, (shape & 1) << 2 | (~shape & 2) | shape >> 2)


def _in_quarter(angle: Array, quarter: int, tolerance: float) -> np.ndarray:
    low = quarter * QUARTER_TURN
    return np.asarray((angle > low - tolerance) & (angle < low + QUARTER_TURN + tolerance))


@dataclass(frozen=True)
class WrittenShape:
    """A shape of the arm that a language says in words, which no correction writes anew.

    Attributes:
        shapes: numbers of the shapes that the words leave, the more usual first.
        within: joints from 0, and the ranges [rad] of which one must hold the joint's angle.
    """

    shapes: tuple[int, ...]
    within: tuple[tuple[int, tuple[tuple[float, float], ...]], ...] = ()

    @classmethod
    def of(cls, said: ArmShape, robot: Robot) -> "WrittenShape | str":
        """Return the shape for a robot, in the axes of its controller; or why it is not certain."""
        elbow = said.third_over
        if said.unknown:
            return (
                f"no source says which shape of the arm is '{said.unknown}'; straight moves from known angles keep it"
            )
        if said.elbow_up is not None and said.rear:
            return (
                "the arm reaches over itself to the rear, and which elbow its maker then calls the upper is not known"
            )
        if said.elbow_up is not None:
            elbow = said.elbow_up == elbow_up_is_over(robot)
        if said.rear is None or elbow is None:
            return "its shape of the arm is said in part, the rest is as at the target before"
        if said.fifth_negative is None and not said.within:
            return "its shape of the arm does not say the wrist"
        wrists = (0, 4) if said.fifth_negative is None else (4 * said.fifth_negative,)
        ends = tuple((j, tuple((a * DEG, b * DEG) for a, b in ranges)) for j, ranges in said.within)
        return cls(tuple(int(said.rear) | 2 * int(elbow) | wrist for wrist in wrists), ends)

    @property
    def shape(self) -> int | None:
        """Number of the arm's shape; the first that is left."""
        return self.shapes[0]

    def turns(self, q: Array) -> np.ndarray:
        """Return whether the joints q (n, N) [rad] are in the ranges that are said; at a border either will do."""
        fits = np.ones(q.shape, dtype=bool)
        for joint, ranges in self.within:
            inside = [(q[:, joint] > a - SHAPE_BORDER) & (q[:, joint] < b + SHAPE_BORDER) for a, b in ranges]
            fits[:, joint] = np.any(inside, axis=0)
        return fits

    def correct_numbers(self, arm: CorrectedArm) -> tuple[int, ...]:
        """Return no numbers: the words stay as they are."""
        del arm
        return ()


def elbow_up_is_over(robot: Robot) -> bool:
    """Return whether joint 3 counts more than at the stretched arm where the elbow is up and the arm in front."""
    _, u = _axes(robot, np.zeros((1, 6)))
    left = np.cross([0.0, 0.0, 1.0], _forward(robot) * np.cross(u[0], u[1]))
    return bool(np.sum(left * u[2]) * np.sign(robot.coupling_matrix[2, 2]) > 0.0)
