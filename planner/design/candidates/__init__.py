"""Poses that the cell allows: the pool that the selection draws from."""

__all__ = ["balls", "pool"]
