"""Circular tests in the manner of ISO 230-4: planned, driven, evaluated."""

__all__ = ["configurations", "document", "evaluation", "figures", "plan", "planning"]
