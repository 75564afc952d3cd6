"""Basis functions, parameters, and the registry of physical causes."""

__all__ = [
    "backlash",
    "basis",
    "catalogue",
    "compliance",
    "context",
    "effect",
    "excitation",
    "gauge_errors",
    "gauge_shapes",
    "gears",
    "nonparametric",
    "parameters",
    "phi_keys",
    "steps",
]
