"""Measurements with an evaluation of their own: accuracy, centring, checks, circular test, loaded bar, simulation."""

__all__ = ["accuracy", "centring", "check", "circular", "live_gauge", "loaded", "opcua", "record", "simulation"]
