"""The report of a calibration: a page that works offline, its first sheet for the customer, and pictures for print."""

from planner.report.calibration.writing import report_html, report_pictures, write_calibration_report

__all__ = ["report_html", "report_pictures", "write_calibration_report"]
