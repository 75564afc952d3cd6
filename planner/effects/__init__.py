"""Basis functions, parameters, and the registry of physical causes."""

__all__ = [
    "backlash", "basis", "catalogue", "compliance", "context", "drift_shapes", "effect", "free_laws",
    "gauge_errors", "gauge_shapes", "gauge_unknowns", "gears", "misfit_shapes", "nonparametric", "own_places",
    "phi_keys", "sessions", "sizes", "steps", "usual_errors",
]  # fmt: skip
