"""Poses that tell the findings of an identification from their rivals."""

from planner.separating.counting import enough, scarce
from planner.separating.file import Identified, read_identified
from planner.separating.separate import Separated, separate
from planner.separating.types import UNSURE, Separation, Told

__all__ = ["UNSURE", "Identified", "Separated", "Separation", "Told", "enough", "read_identified", "scarce", "separate"]
