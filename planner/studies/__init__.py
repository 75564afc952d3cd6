"""Observability of a bar and its fixtures offline: maps, curves, numbers of fixtures."""

__all__ = ["cell_study", "observability", "study_call", "sweep"]
