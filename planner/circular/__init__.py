"""Circular tests in the manner of ISO 230-4: planned with the arm's own limits in sight, and evaluated."""

from planner.circular.arc import off_circle, plan_arc, timed
from planner.circular.evaluation import CircularTest, evaluate_circles
from planner.circular.file import (
    circular_content,
    circular_identity,
    circular_text,
    is_circular,
    read_circular_plan,
)
from planner.circular.passes import measured_passes
from planner.circular.types import Arc, CircularDrive, CircularPlan, Pass

__all__ = [
    "Arc",
    "CircularDrive",
    "CircularPlan",
    "CircularTest",
    "Pass",
    "circular_content",
    "circular_identity",
    "circular_text",
    "evaluate_circles",
    "is_circular",
    "measured_passes",
    "off_circle",
    "plan_arc",
    "read_circular_plan",
    "timed",
]
