"""Neutral moves, the dialects of the controllers, and their programs read back."""

__all__ = ["dialect", "instructions", "languages", "rendering", "verification"]
