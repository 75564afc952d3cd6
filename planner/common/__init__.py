"""Errors with exit codes, units at the border, files written as a whole, schema checks, results."""

__all__ = ["determinism", "errors", "files", "progress", "result", "schema", "units"]
