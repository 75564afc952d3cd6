"""Placement of the gauge, fit, covariance, validation, diagnostics of the residual."""

__all__ = [
    "baseline",
    "calibrated_robot",
    "calibration",
    "contenders",
    "covariance",
    "cross_validation",
    "error_parts",
    "expected_error",
    "identifiable_parameters",
    "least_squares",
    "own_errors",
    "pipeline",
    "posterior_background",
    "problem",
    "released_robot",
    "residual_table",
    "row_basis",
    "run_setup",
    "stages",
    "zeros_set",
]
