"""Arrays by row, errors with exit codes, units at the border, files written as a whole, schema checks, results."""

__all__ = [
    "arrays",
    "calls",
    "choices",
    "determinism",
    "errors",
    "extensions",
    "files",
    "lazy_modules",
    "numbers",
    "progress",
    "quiet",
    "remarks",
    "result",
    "result_folder",
    "schema",
    "second_process",
    "sequences",
    "system",
    "units",
    "xml_files",
]
