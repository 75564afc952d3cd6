"""A measured run: load, check, synchronise, save."""

from planner.run.types import Readings, Run, Samples

__all__ = ["Readings", "Run", "Samples"]
