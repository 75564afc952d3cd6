"""The gauges, one file each; registered in the cell's registry, so that other rooms see only their protocol."""

__all__ = ["frame_gauge", "placement", "several_lengths", "vision"]
