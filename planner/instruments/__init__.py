"""Measurements with an evaluation of their own: accuracy, centring, the circular test, the loaded bar."""

__all__ = ["accuracy", "centring", "circular", "loaded"]
