"""Targets and programs corrected for the identified robot."""

__all__ = ["compensated_file", "program_error", "rotations", "targets"]
