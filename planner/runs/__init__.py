"""A measured run: its columns and clocks, import, checks."""

__all__ = [
    "image_table",
    "joint_motion",
    "loader",
    "proposed_map",
    "repeated_rows",
    "run",
    "scalars",
    "traces",
    "writer",
]
