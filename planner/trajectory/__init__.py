"""Blending and timing: from a collision-free polyline of joint poses to a jerk-limited trajectory along it.

One degree of freedom runs along the path as driven (straight joint legs, corners blended C³); its profile keeps
joint speed, acceleration and jerk and the tool point's speed, and stands still only where the tour rests.
"""

from planner.trajectory.check import LimitReport, check_limits
from planner.trajectory.limits import Limits
from planner.trajectory.percent import axis_percent
from planner.trajectory.plan import blend_corners, plan_trajectory
from planner.trajectory.table import table, table_csv
from planner.trajectory.trajectory import Motion, Trajectory

__all__ = [
    "LimitReport",
    "Limits",
    "Motion",
    "Trajectory",
    "axis_percent",
    "blend_corners",
    "check_limits",
    "plan_trajectory",
    "table",
    "table_csv",
]
