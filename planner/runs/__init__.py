"""A measured run: its columns and clocks, import, checks."""

__all__ = ["joint_motion", "loader", "run", "traces", "writer"]
