"""The calibrated robot: written from a calibration, readable wherever a nominal one is, and where its flange stands."""

from planner.calibrated.files import calibrated_files, calibrated_meshes
from planner.calibrated.robot import CalibratedRobot

__all__ = ["CalibratedRobot", "calibrated_files", "calibrated_meshes"]
