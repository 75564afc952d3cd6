"""Predicted readings, identification Jacobian and noise of a set-up, and the document of what was identified."""

__all__ = [
    "calibration_summary", "columns", "finding", "finding_groups", "gauge_frames", "identification_document",
    "linear_gaussian", "misfit_place", "model", "more_poses", "own_priors", "row_basis", "tool_error",
    "use_statement", "use_text",
]  # fmt: skip
