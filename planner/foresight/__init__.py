"""Poses for what nobody has declared yet: chosen by the error that the robot would keep after it has been traced."""

from planner.foresight.choosing import Foresight, foresee, foreseen
from planner.foresight.unknown import ASSUMED, Unknown, unknown_of

__all__ = ["ASSUMED", "Foresight", "Unknown", "foresee", "foreseen", "unknown_of"]
