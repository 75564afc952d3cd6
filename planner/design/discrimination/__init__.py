"""Poses that tell apart effects that a first run left as rivals."""

__all__ = ["findings", "power", "selection"]
