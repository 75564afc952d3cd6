"""Whether and where a calibrated robot has changed: checks, and the record of its history."""

__all__ = ["evaluation", "planning", "record", "record_changes", "results", "words"]
