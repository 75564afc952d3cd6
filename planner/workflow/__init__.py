"""One function a command."""

__all__ = [
    "accuracy",
    "check_calls",
    "checking",
    "circle_evaluation",
    "compensate_call",
    "compensation",
    "identification",
    "identify_call",
    "loaded_planning",
    "plan_call",
    "plan_results",
    "plan_use",
    "plan_use_calls",
    "planning",
    "recording",
    "verbs",
]
