"""A robot as data: kinematic rows, limits, masses and bodies, read from ``robot.toml`` or a URDF."""

from planner.robot.model import BASE, LinkMass, Loads, Robot, RobotEffect
from planner.robot.reading import load_robot, shipped_robots

__all__ = ["BASE", "LinkMass", "Loads", "Robot", "RobotEffect", "load_robot", "shipped_robots"]
