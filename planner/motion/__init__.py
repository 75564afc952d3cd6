"""Collision, path, tour and timing; this room alone imports the compiled packages of planning."""

__all__ = ["collision", "path", "planning_packages", "timing", "tour"]
