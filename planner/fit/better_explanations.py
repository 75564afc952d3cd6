"""What would help where a run does not belong to its robot: another unit, another robot, angles counted otherwise.

Where a robot's file lacks the coupling of a parallelogram or a wrist, every pose is hundreds of millimetres off, and
no fit of small errors can show why. Where a cell names another robot, a fit bends its links until they are that one's.
Each such change is therefore tried, with the gauge placed anew and nothing of the robot fitted.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import combinations, permutations

import numpy as np

from planner.cell.cell import Cell
from planner.common.determinism import even_positions
from planner.common.errors import NoSolutionError, PlannerError
from planner.common.units import MM
from planner.fit.assumptions import GROSS, OTHER_WAY_SHARE
from planner.fit.identifiable_parameters import identifiable_subset, parameters_of_groups
from planner.fit.least_squares import fit
from planner.fit.problem import FitProblem
from planner.fit.run_setup import locate_gauge, setup_for_run
from planner.kinematics.robot import Robot
from planner.kinematics.robot_reader import list_robots, load_robot
from planner.model.identification_document import Metrics
from planner.model.model import Model
from planner.runs.run import Run


@dataclass(frozen=True)
class Explanation:
    """A run and a robot as they may have been meant, and what is said of that."""

    run: Run
    robot: Robot
    words: str


def explain_better(cell: Cell, run: Run) -> str:
    """Return how run or robot may have been meant, where far less would be left with the gauge placed; else nothing.

    One kind is tried after the other, the likelier first: where a unit or a robot explains the run, no joints are
    exchanged.
    """
    few = run.take(even_positions(len(run), 300))  # samples of the run
    before = placement_error(cell, few, cell.robot)
    if before < GROSS.another_run:
        return ""
    instead = f" instead of {before / MM:.1f} mm" if np.isfinite(before) else ""
    for kind in (_units_and_robots, _backwards, _in_another_order, _with_coupling):
        tried = [(placement_error(cell, e.run, e.robot), e.words) for e in kind(cell.robot, few)]
        least, words = min(tried, key=lambda pair: pair[0], default=(np.inf, ""))
        if least < OTHER_WAY_SHARE * before:
            return f"{words}, and {least / MM:.1f} mm{instead} would be left before any fit of the robot"
    return ""


@contextmanager
def explain_failure(cell: Cell, run: Run) -> Iterator[None]:
    """Say of a fit that does not come to rest what explains the run better, if anything does.

    Raises:
        NoSolutionError: the fit inside does not come to rest.
    """
    try:
        yield
    except NoSolutionError as error:
        if better := explain_better(cell, run):
            raise NoSolutionError(f"the readings do not belong to this robot: {better}") from error
        raise


def _units_and_robots(own: Robot, run: Run) -> Iterator[Explanation]:
    """Yield the run in other units, and the robots that come with the planner and have joints of the same kinds."""
    if run.readings.length is not None or run.readings.position is not None:
        # millimetres of the units in which lengths may have been written
        for unit, millimetres in (("m", 1e3), ("inches", 25.4), ("cm", 10.0), ("tenths of a mm", 0.1), ("µm", 1e-3)):
            yield Explanation(_times(run, millimetres), own, f"perhaps the readings are in {unit}, not in mm")
    for robot in (load_robot(name) for name in list_robots() if name != own.name):
        if np.array_equal(robot.slides, own.slides):
            yield Explanation(run, robot, f"perhaps the robot is {robot.name}, one of those shipped")


def _times(run: Run, factor: float) -> Run:
    """Return a run whose lengths and positions are a factor as large."""
    read = run.readings
    length, position = (None if v is None else v * factor for v in (read.length, read.position))
    return replace(run, readings=replace(read, length=length, position=position))


def _backwards(own: Robot, run: Run) -> Iterator[Explanation]:
    """Yield robots of which one joint counts backwards, and what to write into the file."""
    for i in range(own.n_joints):
        flipped = own.coupling_matrix.copy()
        flipped[i] *= -1.0
        words = f"perhaps joint {i + 1} counts the other way: give it sense = -1"
        yield Explanation(run, replace(own, coupling_matrix=flipped), words)


def _in_another_order(own: Robot, run: Run) -> Iterator[Explanation]:
    """Yield robots of which the joints stand in another order in the table: two exchanged, or all in reverse."""
    A, n = own.coupling_matrix, own.n_joints
    for i, k in combinations(range(n), 2):
        order = np.arange(n)
        order[[i, k]] = k, i
        words = f"perhaps the columns of joints {i + 1} and {k + 1} are exchanged"
        yield Explanation(run, replace(own, coupling_matrix=A[:, order]), words)
    words = "perhaps the columns of the joints stand in reverse order"
    yield Explanation(run, replace(own, coupling_matrix=A[:, ::-1]), words)


def _with_coupling(own: Robot, run: Run) -> Iterator[Explanation]:
    """Yield robots of which one joint is moved along by another, and what to write into the file."""
    A = own.coupling_matrix
    for i, k in permutations(range(own.n_joints), 2):
        for c in (-1.0, 1.0) if not own.slides[[i, k]].any() else ():
            coupled = A.copy()
            coupled[i, k] += c * np.sign(A[i, i])
            words = f"perhaps joint {k + 1} drives joint {i + 1} along: give it couple = {{ {k + 1} = {c:g} }}"
            yield Explanation(run, replace(own, coupling_matrix=coupled), words)


def placement_error(cell: Cell, run: Run, robot: Robot) -> float:
    """Root mean square error [m] with nothing but the gauge placed on a robot; infinite where that is not possible."""
    try:
        setup = locate_gauge(replace(setup_for_run(cell, run), robot=robot), run)
        model, _ = identifiable_subset(parameters_of_groups(Model.of(setup, cell.plan.free), ("gauge",)), run.samples)
        found = fit(FitProblem.of(model, run, even=True))
    except PlannerError:
        return np.inf
    return Metrics.of(found.problem.residual(found.errors)).rms
