"""Simulated runs of robots with known errors."""

__all__ = ["equilibrium", "simulated_run", "truth"]
