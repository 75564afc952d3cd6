"""What can be told of a cell before anything is planned is told before."""

from collections.abc import Sequence

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import InputError
from planner.motion.collision.surroundings import check_surroundings
from planner.programs.instructions import Centre, Instruction, JointMove
from planner.programs.program_files import write_program
from planner.runs.run import FIRST_MOUNTING
from planner.session.neutral_program import build_program, preparation

NO_PLAN = "0" * 12


def check_cell(cell: Cell, dialects: Sequence[str]) -> None:
    """Write a program of two moves in every dialect, and hold the surroundings against what the robot can reach.

    Raises:
        InputError: naming the key.
    """
    check_surroundings(cell)
    _check_home(cell)
    home = JointMove(tuple(float(v) for v in np.rad2deg(cell.home)), 10.0, 50.0, 5.0)
    body: list[Instruction] = [home]
    if cell.gauge.ball_to_centre(cell, cell.home) is not None:
        body.append(Centre(1, 1))
    body += preparation(cell, FIRST_MOUNTING)
    for name in dialects:
        try:
            write_program(build_program(cell, NO_PLAN, [*body, home]), name, cell.robot.name)
        except InputError as err:
            raise InputError(f"{cell.path}: the program in '{name}' cannot be written: {err}") from err


def _check_home(cell: Cell) -> None:
    robot = cell.robot
    off = np.flatnonzero((cell.home < robot.q_lower) | (cell.home > robot.q_upper))
    if len(off):
        raise InputError(f"{cell.path}: home_deg lies beyond the limit of joint {off[0] + 1}")
