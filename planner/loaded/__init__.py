"""Circles under the load of a bar: the compliance of the joints."""

__all__ = [
    "both_bars", "circle_candidates", "common_fit", "evaluation", "joint_fit", "place_results", "results",
    "types",
]  # fmt: skip
