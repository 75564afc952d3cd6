"""From errors of the rows' angles to what the controller's zeros are off, axis by axis, and back."""

from dataclasses import dataclass

import numpy as np

from planner.common.units import Array
from planner.kinematics.robot import Robot


@dataclass(frozen=True)
class AxisZeros:
    """How zeros of axes follow from errors of the rows' angles.

    A row's angle is θ = A q + θ₀ and the controller's c = M q + z: an error of θ is A M⁻¹ times what c lacks.

    Attributes:
        controller: name of the language whose axes they are; empty where the robot's file states no convention for its
            controller, so that they are the model's joints.
        turn: M A⁻¹, (N, N).
    """

    controller: str
    turn: Array

    @classmethod
    def of(cls, robot: Robot, controller: str | None = None) -> "AxisZeros":
        """Return the zeros for a controller, by default that of the robot's maker."""
        inverse = np.asarray(np.linalg.inv(robot.coupling_matrix), dtype=float)
        for c in robot.conventions:
            if c.controller == (controller or robot.dialect):
                return cls(c.controller, c.matrix @ inverse)
        return cls("", inverse)
