"""One function a command."""

__all__ = [
    "accuracy_call",
    "check_calls",
    "checking",
    "circle_calls",
    "circle_results",
    "compensate_call",
    "compensation",
    "demo",
    "fleet",
    "identification",
    "identify_call",
    "plan_call",
    "plan_kinds",
    "plan_results",
    "plan_use",
    "plan_use_calls",
    "planning",
    "recording",
    "robot_copy",
    "verbs",
]
