"""Arrays by row, errors with exit codes, units at the border, files written as a whole, schema checks, results."""

__all__ = [
    "advice", "calls", "choices", "cluster", "commands", "console", "content_hashes", "determinism", "errors",
    "exchange", "extensions", "file_names", "files", "lazy_modules", "notebook", "numbers", "object_hashes", "progress",
    "quiet", "remarks", "result", "result_folder", "robust", "schema", "second_process", "sequences", "summary",
    "system", "tables", "text_table", "units", "xml_files",
]  # fmt: skip
