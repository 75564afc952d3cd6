"""The report of a plan: a page that works offline, and its pictures for print.

``picture`` says what a picture holds, ``charts`` and ``motion`` make pictures of a plan, ``web`` and ``printed`` draw
them; ``stage`` is the cell in space, drawn by ``stage_web`` and ``stage_print``. All numbers come from ``data``.
"""

from planner.report.writing import write_report

__all__ = ["write_report"]
