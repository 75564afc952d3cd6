"""Distances between the bodies of a cell, by two engines."""

__all__ = ["engines", "scene", "surroundings"]
