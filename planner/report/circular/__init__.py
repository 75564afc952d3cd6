"""Reports of circular tests: the plan, and the measured circles."""

from planner.report.circular.measured import write_test_report
from planner.report.circular.plan import write_plan_report

__all__ = ["write_plan_report", "write_test_report"]
