"""One function a command."""

__all__ = [
    "check_calls",
    "checking",
    "compensate_call",
    "compensation",
    "demo",
    "identification",
    "identify_call",
    "plan_call",
    "plan_results",
    "plan_use",
    "plan_use_calls",
    "planning",
    "recording",
    "verbs",
]
