"""Circular tests in the manner of ISO 230-4: planned, driven, evaluated."""

__all__ = ["evaluation", "figures", "plan", "planned_test", "planning", "program"]
