"""Circles under the load of a bar: the compliance of the joints."""

__all__ = ["circle_candidates", "common_fit", "evaluation", "joint_fit", "results", "types"]
