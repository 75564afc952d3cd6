"""Report of a loaded double ball bar: one page, and the paper's figures 13 to 15 for this run."""

from planner.report.loaded.pictures import pictures
from planner.report.loaded.writing import report_html, write_loaded_report

__all__ = ["pictures", "report_html", "write_loaded_report"]
