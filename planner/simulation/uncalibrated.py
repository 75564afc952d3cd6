"""A drawn robot is one that its cell describes: it errs by no more than the cell says of a robot before calibration."""

from dataclasses import dataclass

import numpy as np

from planner.cell.cell import Cell
from planner.common.units import MM, Array
from planner.kinematics.inverse_kinematics import POINT_TOLERANCE, solve_point_ik
from planner.model.model import Model
from planner.runs.run import Samples


@dataclass(frozen=True)
class UncalibratedBound:
    """What the gauge says of a robot before calibration, and what that makes of drawn errors.

    Attributes:
        most: by which the tool point errs at most, for the sake of the gauge [m].
        factor: on every drawn error of the robot, at most 1: all keep their proportions.
    """

    most: float
    factor: float

    @property
    def text(self) -> str:
        """What was done to the drawn errors."""
        return (
            f"drawn errors of the robot times {self.factor:.4f}: its tool point is off by "
            f"{self.most / MM:g} mm at most at the balls (gauge.head.uncalibrated_mm)"
        )


def bound_uncalibrated_errors(cell: Cell, model: Model, errors: Array) -> UncalibratedBound | None:
    """Return how errors (P,) of a robot are made as small as its cell says; ``None`` where it says nothing of that.

    A head of indicators reads near the centre of a ball alone, so its cell states how far an uncalibrated robot errs at
    most (``uncalibrated_mm``), and its plan counts on that. The tool point's error, by geometry and
    compliance together, is looked at in postures from all over the joints' limits that bring it to the balls.
    """
    head = cell.gauge.head
    if head is None:
        return None
    own = [k for k, p in enumerate(model.parameters) if p.group != "gauge"]
    rows = model.subset(own).rows(Samples.at(states_at_balls(cell)))
    largest = float(np.linalg.norm(rows @ errors[own], axis=1).max(initial=0.0))
    return UncalibratedBound(head.uncalibrated, min(1.0, head.uncalibrated / largest) if largest else 1.0)


def states_at_balls(cell: Cell) -> Array:
    """Return joint angles (n, N) [rad], within their limits, that bring the tool point to the balls of a cell."""
    robot = cell.robot
    # 1000 are led to each ball; about four in ten come there within their limits
    some = np.random.default_rng(0).uniform(robot.q_lower, robot.q_upper, (1000, robot.n_joints))
    led = [solve_point_ik(cell.chain, robot, some, p) for p in cell.p_BS]
    q, off = (np.concatenate(parts) for parts in zip(*led, strict=True))
    within = ((q >= robot.q_lower) & (q <= robot.q_upper)).all(axis=1)
    return np.asarray(q[within & (off < POINT_TOLERANCE)])
