"""A plan: the chosen poses and why, how they are driven, and the file that holds it all."""

from planner.plan.course import Course, Waypoints, axis_limits, course, is_continuous, settled, tool_speed
from planner.plan.file import identity, plan_content, plan_text
from planner.plan.header import DriveFile, PlanFile, PoseFile, WaypointFile, read_plan
from planner.plan.types import Drive, Plan, Role, Visit, signs

__all__ = [
    "Course",
    "Drive",
    "DriveFile",
    "Plan",
    "PlanFile",
    "PoseFile",
    "Role",
    "Visit",
    "WaypointFile",
    "Waypoints",
    "axis_limits",
    "course",
    "identity",
    "is_continuous",
    "plan_content",
    "plan_text",
    "read_plan",
    "settled",
    "signs",
    "tool_speed",
]
