"""The path over time, within the limits of the joints and the tool."""

__all__ = ["curve", "leg_times", "trajectory"]
