"""How close a trajectory comes to its limits, on dense samples of the trajectory itself."""

from dataclasses import dataclass

import numpy as np

from planner.trajectory.limits import Limits
from planner.trajectory.trajectory import Trajectory
from planner.units import Array, frozen

INSIDE = np.array([1e-9, 0.25, 0.5, 0.75, 1.0 - 1e-9])  # of every phase: jerk jumps at its ends
SLACK = 1e-6  # utilisation that still counts as kept: rounding and ruckig's tolerance


@dataclass(frozen=True)
class LimitReport:
    """Largest use of each limit as a share of it: speed, acceleration, jerk (N,) per joint; tool_speed of any leg."""

    speed: Array
    acceleration: Array
    jerk: Array
    tool_speed: float

    @property
    def worst(self) -> float:
        """The largest share of all."""
        joints = max(float(share.max()) for share in (self.speed, self.acceleration, self.jerk))
        return max(joints, self.tool_speed)

    @property
    def ok(self) -> bool:
        """Whether every limit is kept."""
        return self.worst <= 1.0 + SLACK


def check_limits(trajectory: Trajectory, limits: Limits, dt_s: float = 0.01) -> LimitReport:
    """Compare with the limits samples every ``dt_s`` [s], and five in every phase of the profile."""
    start = trajectory.phases.t
    length = np.diff(np.append(start, trajectory.duration_s))
    inner = (start[:, None] + length[:, None] * INSIDE).ravel()
    t = np.sort(np.concatenate([trajectory.sample_times(dt_s), inner]))
    motion = trajectory.at(t)
    leg = np.clip(np.searchsorted(trajectory.waypoint_time, t, side="left") - 1, 0, None)
    leg = np.minimum(leg, len(trajectory.tool_speed_limit) - 1)
    return LimitReport(
        frozen(np.abs(motion.dq).max(axis=0) / limits.speed),
        frozen(np.abs(motion.ddq).max(axis=0) / limits.acceleration),
        frozen(np.abs(motion.dddq).max(axis=0) / limits.jerk),
        float((motion.tool_speed / trajectory.tool_speed_limit[leg]).max()),
    )
