"""Which poses are measured: candidates, observability, selection with a certificate, discrimination of rivals."""

__all__ = [
    "bayesian_design",
    "bayesian_refinement",
    "candidates",
    "discrimination",
    "fixtures",
    "free_parameters",
    "observability",
    "off_grid_bound",
    "pose_selection",
    "selection",
]
