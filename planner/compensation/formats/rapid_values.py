"""RAPID's values in brackets: jointtarget, robtarget, tooldata, wobjdata; and the configuration of a robtarget."""

import re
from dataclasses import dataclass

import numpy as np

from planner.compensation.formats.csv import pose_of
from planner.compensation.shapes import NEAR
from planner.compensation.text import EXPONENT_NUMBER
from planner.units import MM, Array

UNUSED = 8e9  # external axes that are not there read 9E9
QUARTER = np.pi / 2
_CONFIGURED = (0, 3, 5)  # joints whose quarter turns cf1, cf4, cf6 count


def _row(count: int) -> str:
    return r"\[\s*" + r"\s*,\s*".join([EXPONENT_NUMBER] * count) + r"\s*\]"


_POSE = rf"\[\s*{_row(3)}\s*,\s*{_row(4)}\s*\]"
JOINT_TARGET = re.compile(rf"\[\s*{_row(6)}\s*,\s*{_row(6)}\s*\]")
ROB_TARGET = re.compile(rf"\[\s*{_row(3)}\s*,\s*{_row(4)}\s*,\s*{_row(4)}\s*,\s*{_row(6)}\s*\]")
_TOOL = re.compile(rf"\[\s*TRUE\s*,\s*(?P<pose>{_POSE})\s*,.*", re.IGNORECASE | re.DOTALL)
_WORK_OBJECT = re.compile(
    rf"\[\s*FALSE\s*,\s*TRUE\s*,\s*(\"[^\"]*\")?\s*,\s*(?P<user>{_POSE})\s*,\s*(?P<object>{_POSE})\s*\]",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Number:
    """A number as written, and its place."""

    value: float
    start: int
    end: int


def numbers(text: str, place: int) -> list[Number]:
    """Return the numbers of a value in brackets, in order."""
    return [Number(float(m[0]), place + m.start(), place + m.end()) for m in re.finditer(EXPONENT_NUMBER, text)]


def transform(values: list[float]) -> Array:
    """Return the transform (4, 4) [m] of x, y, z [mm] and a quaternion."""
    return pose_of(np.array(values[:3]) * MM, np.array(values[3:7]))


def tool_of(text: str) -> Array | None:
    """Return T_FT (4, 4) [m] of a tooldata that the robot carries, else None."""
    match = _TOOL.fullmatch(text)
    return None if match is None else transform([n.value for n in numbers(match["pose"], 0)])


def work_object_of(text: str) -> Array | None:
    """Return T_WB (4, 4) [m] of a wobjdata that stands still, else None."""
    match = _WORK_OBJECT.fullmatch(text)
    if match is None:
        return None
    user, inside = (transform([n.value for n in numbers(match[k], 0)]) for k in ("user", "object"))
    return np.asarray(user @ inside)


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
            low = quarter * QUARTER
            fits[:, joint] = (q[:, joint] > low - NEAR) & (q[:, joint] < low + QUARTER + NEAR)
        return fits

    def renewed(self, before: int, after: int, q: Array, q_new: Array) -> tuple[int, ...]:
        """Return cf1, cf4, cf6, cfx with what the correction (6,) [rad] carries over a border."""
        changed = [int(np.floor(q_new[j] / QUARTER) - np.floor(q[j] / QUARTER)) for j in _CONFIGURED]
        flips = before ^ after
        cfx = self.cfx ^ ((flips & 1) << 2 | (flips & 2) | flips >> 2)
        return (*(c + d for c, d in zip(self.quarters, changed, strict=True)), cfx)
