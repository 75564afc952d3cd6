"""The command ``edbb``."""

__all__ = ["declared", "terminal"]
