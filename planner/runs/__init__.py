"""A measured run: its columns and clocks, import, checks."""

__all__ = [
    "column_map",
    "frames",
    "image_table",
    "joint_motion",
    "loader",
    "probe_turns",
    "proposed_map",
    "repeated_rows",
    "run",
    "scalars",
    "traces",
    "wrapped_angles",
    "writer",
]
