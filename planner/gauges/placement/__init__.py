"""Where gauges stand and sit, found from a run without a start value."""

__all__ = ["frames", "solver"]
