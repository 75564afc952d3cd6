"""Pages, charts and 3D views."""

__all__ = [
    "accuracy_report", "calibration_charts", "calibration_data", "calibration_report", "cell_view", "chart",
    "check_report", "circular_report", "formatting", "loaded_report", "matplotlib_backend", "page",
    "plan_report", "robot_drawing", "scene",
]  # fmt: skip
