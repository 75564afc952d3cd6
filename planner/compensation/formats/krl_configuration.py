"""KUKA's status and turn."""

from dataclasses import dataclass

import numpy as np

from planner.common.units import Array
from planner.compensation.arm_shapes import NEAR
from planner.compensation.targets import CorrectedArm

ACCURATE = 16  # status bit of a point that was taught on a robot with an accuracy model of its own
_WRIST = 4  # status bit and joint of the wrist


@dataclass(frozen=True)
class StatusTurn:
    """KUKA's status and turn: the shape of the arm, and a bit for each joint that is negative."""

    status: int
    turn: int

    @property
    def shape(self) -> int | None:
        """Number of the arm's shape: bits 0 and 1 are KUKA's own; the sign of A5 is taken from the turn.

        Manuals differ about the sense of status bit 2, none about the turn's.
        """
        return (self.status & 3) | (self.turn >> 4 & 1) << 2

    def turns(self, q: Array) -> np.ndarray:
        """Return whether the joints q (n, N) [rad] have the signs that are said; near zero either will do."""
        negative = (self.turn >> np.arange(q.shape[1])) & 1
        return np.asarray((np.abs(q) < NEAR) | ((q < 0) == (negative == 1)))

    def correct_numbers(self, arm: CorrectedArm) -> tuple[int, ...]:
        """Return status and turn; a bit changes only where the corrected angle contradicts it."""
        turn = renewed_bits(self.turn, arm.q, arm.q_slack)
        status = renewed_bits(self.status & 3, arm.margins[:2], arm.margins_slack[:2]) | self.status & ~3
        return status ^ (_WRIST if (turn ^ self.turn) >> _WRIST & 1 else 0), turn


def renewed_bits(bits: int, values: Array, slack: Array) -> int:
    """Return ``bits`` with bit i set where value i is negative, kept where it is zero but for ``slack``."""
    for i, value in enumerate(values):
        if abs(value) > slack[i]:
            bits = bits | 1 << i if value < 0 else bits & ~(1 << i)
    return bits
