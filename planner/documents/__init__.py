"""What an identification writes: calibration, calibrated robot, expected error, posterior, table of residuals."""

__all__ = [
    "baseline", "calibrated_robot", "calibration", "calibration_summary", "expected_error", "forward",
    "gauge_unit_errors", "residual_table", "zeros_set",
]  # fmt: skip
