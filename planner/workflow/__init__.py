"""One function a command."""

__all__ = [
    "accuracy",
    "both_bars",
    "checking",
    "circle_evaluation",
    "compensation",
    "identification",
    "loaded_places",
    "plan_reading",
    "plan_results",
    "planning",
    "recording",
]
