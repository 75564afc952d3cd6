"""Neutral moves, the dialects of the controllers, and their programs read back."""

__all__ = ["controller_axes", "coupled_axes", "dialect", "instructions", "languages", "rendering", "verification"]
