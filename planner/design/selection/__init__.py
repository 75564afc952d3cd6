"""Optimal design: pruning, exchange, certificates of the indices, refinement."""

__all__ = ["certificate", "d_optimal", "index_bound", "index_search", "pruning"]
