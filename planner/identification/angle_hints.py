"""What would help where a run does not belong to its robot: an axis counted backwards, or one that drives another.

Where a robot's file lacks the coupling of a parallelogram or a wrist, every pose is hundreds of millimetres off, and
no fit of small errors can show why. Each robot with one such change is therefore tried, with the gauge placed anew.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell
from planner.common.determinism import even_positions
from planner.common.errors import PlannerError
from planner.common.units import MM
from planner.identification.assumptions import OTHER_WAY_SHARE
from planner.identification.identifiable_parameters import identifiable_subset, parameters_of_groups
from planner.identification.least_squares import fit
from planner.identification.problem import FitProblem
from planner.identification.run_setup import locate_gauge, setup_for_run
from planner.kinematics.robot import Robot
from planner.model.identification_document import Metrics
from planner.model.model import Model
from planner.runs.run import Run


def angle_hint(cell: Cell, run: Run, rms: float) -> str:
    """Return how the angles may have been meant, where the rms error [m] would then be far smaller; else nothing."""
    few = run.take(even_positions(len(run), 300))  # samples of the run
    tried = [(_placement_error(cell, few, robot), words) for robot, words in _other_countings(cell.robot)]
    least, words = min(tried, key=lambda pair: pair[0])
    if least > OTHER_WAY_SHARE * rms:
        return ""
    return f"{words}, and {least / MM:.1f} mm would be left before any fit of the robot"


def _other_countings(robot: Robot) -> Iterator[tuple[Robot, str]]:
    """Yield robots with one joint counted backwards, or moved along by another one, and what to write into the file."""
    A = robot.coupling_matrix
    for i in range(robot.n_joints):
        flipped = np.where(np.arange(len(A))[:, None] == i, -A, A)
        yield replace(robot, coupling_matrix=flipped), f"perhaps joint {i + 1} counts the other way: give it sense = -1"
    for i in range(robot.n_joints):
        for k in range(robot.n_joints):
            for c in (-1.0, 1.0) if k != i and not robot.slides[[i, k]].any() else ():
                coupled = A.copy()
                coupled[i, k] += c * np.sign(A[i, i])
                words = f"perhaps joint {k + 1} drives joint {i + 1} along: give it couple = {{ {k + 1} = {c:g} }}"
                yield replace(robot, coupling_matrix=coupled), words


def _placement_error(cell: Cell, run: Run, robot: Robot) -> float:
    """Root mean square error [m] with nothing but the gauge placed on a robot; infinite where that is not possible."""
    try:
        setup = locate_gauge(replace(setup_for_run(cell, run), robot=robot), run)
        model, _ = identifiable_subset(parameters_of_groups(Model.of(setup, cell.plan.free), ("gauge",)), run.samples)
        found = fit(FitProblem.of(model, run, even=True))
    except PlannerError:
        return np.inf
    return Metrics.of(found.problem.residual(found.errors)).rms
