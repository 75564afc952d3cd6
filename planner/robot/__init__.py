"""A robot as data: kinematic rows, limits, masses and bodies, read from ``robot.toml`` or a URDF."""

from planner.robot.model import LinkMass, Robot
from planner.robot.reading import load_robot, shipped_robots

__all__ = ["LinkMass", "Robot", "load_robot", "shipped_robots"]
