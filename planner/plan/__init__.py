"""A plan: the chosen poses and why, how they are driven, and the file that holds it all."""

from planner.plan.choice import Choice, choose, what_is_seen
from planner.plan.file import identity, plan_text
from planner.plan.types import Drive, Plan, Role, Verdict, Visit, signs

__all__ = [
    "Choice",
    "Drive",
    "Plan",
    "Role",
    "Verdict",
    "Visit",
    "choose",
    "identity",
    "plan_text",
    "signs",
    "what_is_seen",
]
