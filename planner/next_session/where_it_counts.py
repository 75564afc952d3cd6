"""Where the error of the tool counts: in a box of the workspace, or at the targets of a program that will be driven."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.cell.region_file import states_in_region
from planner.common.determinism import even_positions
from planner.common.units import Array
from planner.compensation.compensated_file import compensate_file
from planner.compensation.targets import ToolAndBase
from planner.documents.calibrated_robot import CalibratedRobot
from planner.kinematics.robot_reader import load_robot
from planner.model.tool_error import WORKSPACE_STATES, uniform_states


@dataclass(frozen=True)
class ErrorPlaces:
    """Joint states at which the error counts, and the tool's points there.

    Attributes:
        words: where that is, as the end of a sentence says it.
        q: states, (n, N) [rad].
        p_FM: tool point of each in the flange, (n, 3) [m]; ``None``: the measured one.
    """

    words: str
    q: Array
    p_FM: Array | None = None


def places_in_region(path: Path, cell: Cell) -> ErrorPlaces:
    """Return the states in which the measured tool point is in the box of a file.

    Raises:
        InputError: as of ``states_in_region``.
    """
    # 10: times as many states as are kept, of which a box holds a part
    inside = states_in_region(path, cell, uniform_states(cell, 10 * WORKSPACE_STATES, 0))
    return ErrorPlaces(f"in {path.name}", inside[:WORKSPACE_STATES])


def places_of_program(path: Path, robot_file: Path) -> ErrorPlaces:
    """Return the targets of a program with their tools, as ``edbb compensate`` reads them for a calibrated robot.

    Of targets that are joint angles the tool is the measured one.

    Raises:
        InputError: the program is not understood, or none of its targets is certain.
    """
    robot = load_robot(robot_file)
    own = robot.tool_points[0].p_FM if len(robot.tool_points) == 1 else np.zeros(3)
    done = compensate_file(path, robot.nominal_robot, CalibratedRobot(robot), frames=ToolAndBase(p_FM=own))
    few = even_positions(len(done.q), WORKSPACE_STATES)
    tools = [done.targets[k].pose for k in few]
    p_FM = np.array([own if pose is None else pose.T_FT[:3, 3] for pose in tools])
    return ErrorPlaces(f"at the targets of {path.name}", done.q[few], p_FM)
