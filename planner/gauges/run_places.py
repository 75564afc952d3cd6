"""What every gauge needs of a run to place itself: names that the cell knows, flange poses, targets on the tool."""

import numpy as np

from planner.cell.cell import Cell
from planner.cell.setup import MeasurementSetup
from planner.common.errors import InputError, did_you_mean
from planner.common.units import MM, Array
from planner.runs.run import Run

LOCATED_SIGMA = 20.0 * MM  # one sigma of a frame or tool point that was placed on a robot still millimetres off
LOCATED_TURN_SIGMA = 0.02  # the same of a frame's orientation [rad]


def index_in_cell(run: Run, name: str, known: tuple[str, ...], what: str, cell: Cell) -> int:
    """Return which of the cell's names a name of the run is.

    Raises:
        InputError: it is none of them, or the run leaves out which of several.
    """
    if name in known:
        return known.index(name)
    if name == "" and len(known) == 1:
        return 0
    if name == "":
        raise InputError(
            f"{run.name}: the column '{what}' is missing, and {cell.path} has several ({', '.join(known)})"
        )
    named = {"point": (run.points, run.samples.point), "ball": (run.balls, run.readings.ball)}
    names, which = named.get(what, (run.places, run.samples.place))
    where = run.name if which is None else run.where(int(np.argmax(which == names.index(name))))
    raise InputError(
        f"{where}: {what} '{name}' is not in {cell.path}{did_you_mean(name, list(known))} (there: {', '.join(known)})"
    )


def flange_poses(setup: MeasurementSetup, q: Array) -> tuple[Array, Array]:
    """Positions (n, 3) [m] and orientations (n, 3, 3) of the flange of the nominal robot."""
    motion = setup.robot.chain.forward(setup.robot.theta(q))
    return motion.x.T.copy(), motion.R.transpose(2, 0, 1).copy()


def points_of(run: Run) -> np.ndarray:
    """Return which target on the tool each sample is of, (n,) int."""
    return np.zeros(len(run), dtype=int) if run.samples.point is None else run.samples.point
