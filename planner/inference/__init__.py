"""Which causes act and how large they are: posterior draws, inclusion probabilities, model comparison, misfit."""

__all__ = [
    "candidates", "comparison_columns", "misfit", "model_comparison", "posterior_background", "posterior_draws",
    "posterior_fit", "stages",
]  # fmt: skip
