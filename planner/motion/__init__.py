"""Collision, path, tour and timing."""

__all__ = ["collision", "path", "timing", "tour"]
