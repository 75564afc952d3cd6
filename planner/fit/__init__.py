"""The fit of a model to a run: placement of the gauge, noise, least squares, covariance, cross-validation."""

__all__ = [
    "artifact_pose", "assumptions", "axis_zeros", "better_explanations", "covariance", "cross_validation",
    "gross_errors", "identifiable_parameters", "influence", "least_squares", "noise", "problem",
    "residual_alternatives", "run_setup", "wild_rows",
]  # fmt: skip
