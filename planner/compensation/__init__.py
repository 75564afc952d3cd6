"""Targets and programs corrected for the identified robot."""

__all__ = [
    "compensated_file",
    "correction_mark",
    "few_axes",
    "program_error",
    "rotations",
    "targets",
    "tool_notes",
]
