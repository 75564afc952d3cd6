"""One function a command."""

__all__ = [
    "accuracy",
    "checking",
    "circle_evaluation",
    "compensation",
    "identification",
    "loaded_planning",
    "plan_call",
    "plan_results",
    "plan_use",
    "planning",
    "recording",
    "verbs",
]
