"""The two papers that the planner was made from: each of their statements, and our number beside it."""

__all__ = ["papers_call", "papers_result"]
