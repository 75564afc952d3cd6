"""A head of indicators centred on balls in a closed loop."""

__all__ = ["indicators", "protocols", "robot_link", "session", "settings", "simulated", "stop"]
