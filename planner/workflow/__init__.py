"""One function a command."""

__all__ = [
    "accuracy_call", "check_calls", "checking", "circle_calls", "compensate_call", "compensation", "core_calls",
    "demo", "fleet", "identification", "loaded_planning", "many", "plan_kinds", "plan_results", "plan_use",
    "planning", "recording", "robot_copy", "verbs",
]  # fmt: skip
