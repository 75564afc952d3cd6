"""The command ``edbb``."""

__all__ = ["terminal"]
