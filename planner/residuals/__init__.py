"""Is what a fit leaves chance? Tests of the residual along everything that was logged."""

from planner.residuals.judge import leftover

__all__ = ["leftover"]
