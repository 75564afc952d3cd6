"""A measured run: its columns and clocks, import, checks."""

__all__ = [
    "column_map", "image_table", "joint_motion", "loader", "probe_turns", "proposed_map", "run", "traces",
    "writer",
]  # fmt: skip
