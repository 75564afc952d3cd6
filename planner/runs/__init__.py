"""A measured run: its columns and clocks, import, checks."""

__all__ = ["joint_motion", "loader", "reference_readings", "run", "traces", "writer"]
