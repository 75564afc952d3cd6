"""OpenCV's robot-world-hand-eye, which its releases 4 have and its release 5 no longer offers in Python."""

from collections.abc import Callable
from typing import Any

import cv2

METHODS = {"Shah": "CALIB_ROBOT_WORLD_HAND_EYE_SHAH", "Li": "CALIB_ROBOT_WORLD_HAND_EYE_LI"}


def robot_world_hand_eye() -> Callable[..., Any]:
    """The function ``calibrateRobotWorldHandEye`` of the OpenCV that is installed.

    Raises:
        SystemExit: this OpenCV has none, and which release has.
    """
    found: Callable[..., Any] | None = getattr(cv2, "calibrateRobotWorldHandEye", None)
    if found is None:
        raise SystemExit(
            f"OpenCV {cv2.__version__} has no calibrateRobotWorldHandEye, against which this benchmark compares; "
            "OpenCV 4 has it: pip install 'opencv-python-headless<5'"
        )
    return found
