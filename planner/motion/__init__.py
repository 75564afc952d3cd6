"""Collision, path, tour and timing."""

__all__ = ["collision", "path", "planning_packages", "timing", "tour"]
