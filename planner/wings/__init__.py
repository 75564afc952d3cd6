"""Extensions that come with the planner, a module each; the core does without any of them, and knows no name of one."""

__all__ = ["names"]

SECTIONS = {"circles": "circles"}
"""The extension that reads a section of cell files; it is named where it is left out."""
