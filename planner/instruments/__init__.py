"""Measurements with an evaluation of their own: accuracy, centring, checks, the circular test, the loaded bar."""

__all__ = ["accuracy", "centring", "check", "circular", "loaded", "record"]
