"""RAPID's confdata."""

from dataclasses import dataclass

import numpy as np

from planner.common.units import Array
from planner.compensation.arm_shapes import NEAR
from planner.compensation.formats.krl_configuration import renewed_bits
from planner.compensation.targets import CorrectedArm

QUARTER = np.pi / 2
_CONFIGURED = (0, 3, 5)  # joints whose quarter turns cf1, cf4, cf6 count


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
        for joint, quarter in zip(_CONFIGURED, self.quarters, strict=True):
            fits[:, joint] = _in_quarter(q[:, joint], quarter, NEAR)
        return fits

    def correct_numbers(self, arm: CorrectedArm) -> tuple[int, ...]:
        """Return cf1, cf4, cf6, cfx; a number changes only where the corrected angle contradicts it."""
        quarters = [
            quarter if _in_quarter(arm.q[j], quarter, arm.q_slack[j]) else int(np.floor(arm.q[j] / QUARTER))
            for j, quarter in zip(_CONFIGURED, self.quarters, strict=True)
        ]
        shape = renewed_bits(self.shape or 0, arm.margins, arm.margins_slack)
        return (*quarters, (shape & 1) << 2 | (~shape & 2) | shape >> 2)


def _in_quarter(angle: Array, quarter: int, tolerance: float) -> np.ndarray:
    low = quarter * QUARTER
    return np.asarray((angle > low - tolerance) & (angle < low + QUARTER + tolerance))
