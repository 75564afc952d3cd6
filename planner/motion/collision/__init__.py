"""Distances between the bodies of a cell, by two engines."""

__all__ = ["body_gaps", "engines", "scene", "surroundings"]
