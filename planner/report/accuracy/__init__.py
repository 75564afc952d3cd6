"""Report of a validation by a tracker, or of repeated centrings: one page, and its picture for print."""

from planner.report.accuracy.writing import precision_report, validation_report

__all__ = ["precision_report", "validation_report"]
