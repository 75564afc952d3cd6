"""What gauges without a bar would read: a head centred on its balls, a tracker that sees the reflector, the nests."""

from dataclasses import replace

import numpy as np

from planner.cell import Cell
from planner.cell.placed import nests_frame
from planner.model import Model
from planner.rig import Targets
from planner.run import Readings, Samples
from planner.run.beside import Beside
from planner.units import UM, Array, frozen

MASTERED = 0.5 * UM  # scatter of an indicator on the master ball
STEPS = 8  # of Newton's method from a planned pose to the centred one, millimetres away


def simulated_points(
    cell: Cell, model: Model, errors: Array, samples: Samples, off: Array, rng: np.random.Generator
) -> tuple[Samples, Readings]:
    """Return the samples as they are recorded, and the readings.

    Args:
        cell: the cell; artifact or tracker stand where it says, but for the errors that the model has of that.
        model, errors: the robot as it is, (P,).
        samples: where the arm is told to stand.
        off: what the joints are off by, (n, N) [rad].
        rng: of the gauge's noise.
    """
    noise = model.rig.noise * rng.standard_normal((len(samples), 3))
    if cell.gauge.head is None:
        place = cell.fixtures[0]
        x = _point(model, samples, off, errors)
        return samples, Readings(position=frozen((x - place.p_BX) @ place.R_BX + noise))
    ball = np.argmin(np.linalg.norm(cell.map_position(samples.q)[:, None] - cell.p_BS[None], axis=2), axis=1)
    goal = cell.p_BS[ball] + noise
    for _ in range(STEPS):
        missing = goal - _point(model, samples, off, errors)
        J = model.joint_rows(samples)
        samples = replace(samples, q=samples.q + np.einsum("nij,nj->ni", np.linalg.pinv(J), missing))
    return replace(samples, q=frozen(samples.q)), Readings(ball=ball)


def simulated_beside(cell: Cell, rng: np.random.Generator) -> Beside:
    """Return what is read before the poses: a tracker's nests, or twice a head's indicators at the master ball."""
    if cell.gauge.head is not None:
        wanted = cell.gauge.head.master / 2 - cell.balls[0].radius
        return Beside(masters=tuple(frozen(wanted + MASTERED * rng.standard_normal(3)) for _ in range(2)))
    R_BW, p_BW = nests_frame(cell.file)
    place = cell.fixtures[0]
    seen = [(n.name, (R_BW @ n.p_WN + p_BW - place.p_BX) @ place.R_BX) for n in cell.nests]
    return Beside(tuple((name, frozen(p + cell.gauge.noise * rng.standard_normal(3))) for name, p in seen))


def _point(model: Model, samples: Samples, off: Array, errors: Array) -> Array:
    """Where the measured point is, (n, 3) [m]."""
    there = replace(samples, q=samples.q + off)
    return -model.residual(there, Targets(position=np.zeros((len(samples), 3))), errors)
