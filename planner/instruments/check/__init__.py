"""A check: a few poses tell whether and where a calibrated robot has changed."""

__all__ = ["evaluation", "planning", "results", "words"]
