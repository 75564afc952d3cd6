"""Loaded double ball bar: joint compliances from loaded circles, and the circle as it would be without load."""

from planner.loaded.averaging import averaged_curves
from planner.loaded.centring import centring_offset, paper_offset
from planner.loaded.compliance import compliances
from planner.loaded.evaluate import Options, evaluate
from planner.loaded.told import Combination, Compliances
from planner.loaded.types import Circle, Comparison, Curves, Evaluated, Loaded, Offset

__all__ = [
    "Circle",
    "Combination",
    "Comparison",
    "Compliances",
    "Curves",
    "Evaluated",
    "Loaded",
    "Offset",
    "Options",
    "averaged_curves",
    "centring_offset",
    "compliances",
    "evaluate",
    "paper_offset",
]
