"""Circles under the load of a bar: the compliance of the joints."""

__all__ = ["circle", "compliance", "equilibrium", "evaluation", "joint_fit", "results", "types"]
