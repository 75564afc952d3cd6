"""Observability offline: maps, curves, fixtures, places of loaded circles."""

__all__ = ["cell_study", "compliance_design", "fixture_addition"]
