"""The folder for Windows, run by Wine: long tests, skipped where Wine is missing."""
