"""Observability of a bar and its fixtures offline: maps, curves, numbers of fixtures."""

__all__ = ["cell_study", "study_call", "sweep"]
