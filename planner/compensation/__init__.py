"""Targets and programs corrected for the identified robot."""

__all__ = [
    "compensated_file", "compensated_program", "correction_mark", "few_axes", "languages", "program_error",
    "program_text", "rotations", "targets", "tool_notes",
]  # fmt: skip
