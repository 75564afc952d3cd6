"""What would help where a run does not belong to its robot: another unit, another robot, angles counted otherwise.

Where a robot's file lacks the coupling of a parallelogram or a wrist, every pose is hundreds of millimetres off, and
no fit of small errors can show why; where a cell names another robot, a fit bends its links until they are that one's.
Each such change is therefore tried, with the gauge placed anew and nothing of the robot fitted.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from planner.cell.cell import Cell
from planner.common.determinism import even_positions
from planner.common.errors import PlannerError
from planner.common.units import MM, Array
from planner.identification.assumptions import OTHER_WAY_SHARE
from planner.identification.identifiable_parameters import identifiable_subset, parameters_of_groups
from planner.identification.least_squares import fit
from planner.identification.problem import FitProblem
from planner.identification.run_setup import locate_gauge, setup_for_run
from planner.kinematics.robot import Robot
from planner.kinematics.robot_reader import list_robots, load_robot
from planner.model.identification_document import Metrics
from planner.model.model import Model
from planner.runs.run import Run

UNITS = (("m", 1e3), ("inches", 25.4), ("cm", 10.0), ("tenths of a mm", 0.1), ("µm", 1e-3))
"""Units in which lengths may have been written, and how many millimetres each has."""


@dataclass(frozen=True)
class Explanation:
    """A run and a robot as they may have been meant, and what is said of that."""

    run: Run
    robot: Robot
    words: str


def explain_better(cell: Cell, run: Run) -> str:
    """Return how run or robot may have been meant, where far less would be left with the gauge placed; else nothing.

    Units and robots are tried first: where one of them explains the run, no angles are exchanged.
    """
    few = run.take(even_positions(len(run), 300))  # samples of the run
    before = placement_error(cell, few, cell.robot)
    instead = f" instead of {before / MM:.1f} mm" if np.isfinite(before) else ""
    for kind in (_units_and_robots(cell.robot, few), _other_countings(cell.robot, few)):
        tried = [(placement_error(cell, e.run, e.robot), e.words) for e in kind]
        least, words = min(tried, key=lambda pair: pair[0])
        if least < OTHER_WAY_SHARE * before:
            return f"{words}, and {least / MM:.1f} mm{instead} would be left before any fit of the robot"
    return ""


def _units_and_robots(own: Robot, run: Run) -> Iterator[Explanation]:
    """Yield the run in other units, and the robots that come with the planner and have joints of the same kinds."""
    if run.readings.length is not None or run.readings.position is not None:
        for unit, millimetres in UNITS:
            yield Explanation(_times(run, millimetres), own, f"perhaps the readings are in {unit}, not in mm")
    for robot in (load_robot(name) for name in list_robots() if name != own.name):
        if np.array_equal(robot.slides, own.slides):
            yield Explanation(run, robot, f"perhaps the robot is {robot.name}, one of those shipped")


def _times(run: Run, factor: float) -> Run:
    """Return a run whose lengths and positions are a factor as large."""
    read = run.readings
    length, position = (None if v is None else v * factor for v in (read.length, read.position))
    return replace(run, readings=replace(read, length=length, position=position))


def _other_countings(robot: Robot, run: Run) -> Iterator[Explanation]:
    """Yield robots whose joints are counted otherwise, and what to write into the file or the table.

    One joint counts backwards, two are exchanged, or one is moved along by another.
    """
    A, n = robot.coupling_matrix, robot.n_joints

    def counted(matrix: Array, words: str) -> Explanation:
        """Return the robot with another matrix from the controller's angles to its own."""
        return Explanation(run, replace(robot, coupling_matrix=matrix), f"perhaps {words}")

    for i in range(n):
        flipped = np.where(np.arange(n)[:, None] == i, -A, A)
        yield counted(flipped, f"joint {i + 1} counts the other way: give it sense = -1")
    for i, k in combinations(range(n), 2):
        order = np.arange(n)
        order[[i, k]] = k, i
        yield counted(A[:, order], f"the columns of joints {i + 1} and {k + 1} are exchanged")
    yield counted(A[:, ::-1], "the columns of the joints stand in reverse order")
    for i in range(n):
        for k in range(n):
            for c in (-1.0, 1.0) if k != i and not robot.slides[[i, k]].any() else ():
                coupled = A.copy()
                coupled[i, k] += c * np.sign(A[i, i])
                words = f"joint {k + 1} drives joint {i + 1} along: give it couple = {{ {k + 1} = {c:g} }}"
                yield counted(coupled, words)


def placement_error(cell: Cell, run: Run, robot: Robot) -> float:
    """Root mean square error [m] with nothing but the gauge placed on a robot; infinite where that is not possible."""
    try:
        setup = locate_gauge(replace(setup_for_run(cell, run), robot=robot), run)
        model, _ = identifiable_subset(parameters_of_groups(Model.of(setup, cell.plan.free), ("gauge",)), run.samples)
        found = fit(FitProblem.of(model, run, even=True))
    except PlannerError:
        return np.inf
    return Metrics.of(found.problem.residual(found.errors)).rms
