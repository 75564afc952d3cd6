"""From the residual of a fit to named effects."""

__all__ = ["trace"]
