"""Errors with exit codes, units at the border, files written as a whole, schema checks, results."""

__all__ = [
    "choices",
    "determinism",
    "errors",
    "files",
    "lazy_modules",
    "progress",
    "reading",
    "result",
    "result_folder",
    "schema",
    "second_process",
    "sequences",
    "time_limit",
    "units",
]
