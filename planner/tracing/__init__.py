"""From the residual to its causes: search over the catalogue, rivals, detection limits."""

from planner.tracing.trace import trace

__all__ = ["trace"]
