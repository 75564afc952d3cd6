"""Which poses are measured: candidates, observability, selection with a certificate, discrimination of rivals."""

__all__ = [
    "assumptions", "bayesian_design", "candidates", "discrimination", "expected_errors", "fixtures",
    "foresight_text", "free_parameters", "learnt_sizes", "observability", "off_grid", "pose_selection",
    "selection", "target_errors", "unnamed_errors",
]  # fmt: skip
