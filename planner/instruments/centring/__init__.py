"""A head of indicators centred on balls in a closed loop."""

__all__ = ["indicators", "robot_link", "session", "settings", "simulated", "stop"]
