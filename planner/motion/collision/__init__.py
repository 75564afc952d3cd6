"""Distances between the bodies of a cell, by two engines."""

__all__ = ["engines", "fcl_world", "meshes", "pieces", "scene", "surroundings"]
