"""From the posterior to the robot that is released: its expected error, what stays unseen, the causes it names."""

__all__ = [
    "causes", "error_history", "error_parts", "nominal_comparison", "released_parameters", "released_robot",
    "releasing", "suitability", "tool_map",
]  # fmt: skip
