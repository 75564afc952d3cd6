"""How far from the centre of a head an uncalibrated robot first meets a ball (TriCal paper, section 3)."""

import numpy as np
from scipy.stats import chi2

from planner.cell import Cell
from planner.errors import InputError
from planner.model import Model
from planner.units import Array, to_mm

LEVEL = 0.95
STATES = 2000  # of the whole arm, over which its errors are held to what the cell says of them


class FirstContact:
    """Predicts the error of the measured point before calibration, pose by pose.

    The covariance is the prior one of all errors of the robot, of the artifact's place and of the tool point as it was
    mastered: C = J Σ Jᵀ. How the robot's share is spread over its poses comes from J and the prior sizes; its size is
    the cell's own figure, ``uncalibrated``, which the 95 % bounds of no pose exceed.
    """

    def __init__(self, cell: Cell) -> None:
        model = Model.from_cell(cell, frozenset({"fixture", "tool"}))
        robot = [k for k, p in enumerate(model.parameters) if p.group != "gauge"]
        self._robot = model.subset(robot)
        self._rest = model.subset([k for k in range(len(model.parameters)) if k not in robot])
        head = cell.gauge.head
        if head is None:
            raise InputError(f"{cell.path}: only a head of indicators has a first contact")
        rng = np.random.default_rng(0)
        states = rng.uniform(cell.robot.q_lower, cell.robot.q_upper, (STATES, cell.robot.n_joints))
        self._scale = (head.uncalibrated / bound_of(_spread(self._robot, states)).max()) ** 2

    def at(self, q: Array) -> Array:
        """Return the distance from the centre that holds at ``LEVEL``, (n,) [m], for angles q (n, N) [rad]."""
        return bound_of(self._scale * _spread(self._robot, q) + _spread(self._rest, q))


def bound_of(covariance: Array) -> Array:
    """Return the ``LEVEL`` quantile of the length of normal vectors with covariance (n, 3, 3), (n,).

    The squared length is a weighted sum of χ²; its first two moments fit a scaled χ² (Satterthwaite 1946).
    """
    trace = np.trace(covariance, axis1=1, axis2=2)
    square = np.einsum("nij,nji->n", covariance, covariance)
    degrees = trace**2 / square
    return np.asarray(np.sqrt(square / trace * chi2.ppf(LEVEL, degrees)))


def too_far(cell: Cell, found: Array) -> str:
    """Say what would help where the first contact lies beyond what the head can take, everywhere."""
    head = cell.gauge.head
    assert head is not None
    return (
        f"the uncalibrated robot would meet it {float(to_mm(found.min())):.1f} mm or more off centre at every pose "
        f"(95 %), and the indicators make contact within {float(to_mm(head.usable)):g} mm: place the artifact better "
        "(artifact.prior_mm, prior_deg), or calibrate roughly first (gauge.head.uncalibrated_mm)"
    )


def _spread(model: Model, q: Array) -> Array:
    """Covariance of the measured point from the prior sizes of a model's parameters, (n, 3, 3) [m²]."""
    rows = model.jacobian(q) * model.prior
    return np.asarray(rows @ np.swapaxes(rows, 1, 2))
