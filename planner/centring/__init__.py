"""A head of indicators centred on balls in a closed loop, and a bar that is read while the arm moves."""

__all__ = ["indicators", "journal", "live_session", "robot_link", "session", "settings", "simulated", "stop"]
