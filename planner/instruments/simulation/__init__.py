"""Runs of robots with known errors."""

__all__ = ["measurement", "truth"]
