"""Extensions that come with the planner, a module each; the core does without any of them, and knows no name of one."""

__all__ = ["names"]
