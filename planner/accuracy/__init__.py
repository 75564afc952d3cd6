"""Before and after by poses of their own: ISO 9283, frames of a tracker, precision."""

__all__ = ["assumptions", "precision", "tracker_nests", "validation"]
