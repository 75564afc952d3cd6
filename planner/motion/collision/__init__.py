"""Distances between the bodies of a cell, by two engines."""

__all__ = ["engines", "placed_shapes", "scene", "surroundings"]
