"""Basis functions, parameters, and the registry of physical causes."""

__all__ = [
    "basis",
    "catalogue",
    "compliance",
    "context",
    "effect",
    "excitation",
    "gauge_errors",
    "gears",
    "geometry",
    "nonparametric",
    "parameters",
    "phi_keys",
    "steps",
]
