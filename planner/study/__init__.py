"""Observability offline: what can be seen, with how many poses, how strongly, from which fixture."""

from planner.study.run import study
from planner.study.summary import StudySummary

__all__ = ["StudySummary", "study"]
