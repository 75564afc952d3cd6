"""Targets and programs corrected for the identified robot."""

__all__ = ["compensated_file", "correction_mark", "program_error", "rotations", "targets"]
