"""A plan: the chosen poses and why, how they are driven, and the file that holds it all."""

from planner.plan.choice import Choice, choose, what_is_seen
from planner.plan.course import Course, Waypoints, axis_limits, course, is_continuous, settled
from planner.plan.file import identity, plan_content, plan_text
from planner.plan.types import Drive, Plan, Role, Verdict, Visit, signs

__all__ = [
    "Choice",
    "Course",
    "Drive",
    "Plan",
    "Role",
    "Verdict",
    "Visit",
    "Waypoints",
    "axis_limits",
    "choose",
    "course",
    "identity",
    "is_continuous",
    "plan_content",
    "plan_text",
    "settled",
    "signs",
    "what_is_seen",
]
