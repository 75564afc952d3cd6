"""What is checked of a cell and of the languages of its programs before any planning."""

from collections.abc import Sequence

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import InputError
from planner.motion.collision.surroundings import check_surroundings
from planner.motion.tour.solve import require_concorde
from planner.programs.controller_axes import axis_convention
from planner.programs.dialect import load_dialect
from planner.programs.instructions import Centre, Instruction, JointMove
from planner.runs.run import FIRST_MOUNTING
from planner.session.neutral_program import build_program, preparation, write_session
from planner.session.options import PlanOptions

ANY_ROBOT = "poses-csv"
"""Written where neither the cell nor the robot names a language: a list that anybody can read."""


def settle_dialects(cell: Cell, options: PlanOptions) -> tuple[str, ...]:
    """Return the dialects to write; what is wrong with them, the cell or the solver is told before a minute's work.

    Raises:
        InputError: there is no such dialect, the robot's file does not say how its controller counts the axes, or
            the cell is wrong (see :func:`check_cell`).
        MissingProgramError: Concorde was asked for and is not there.
    """
    if options.tsp == "concorde":
        _ = require_concorde()
    dialects = tuple(options.dialect) or cell.controller.dialects or (cell.robot.dialect or ANY_ROBOT,)
    for name in dialects:
        _ = axis_convention(cell.robot, load_dialect(name))
    check_cell(cell, dialects)
    return dialects


def check_cell(cell: Cell, dialects: Sequence[str]) -> None:
    """Write a program of two moves in every dialect, and hold the surroundings against what the robot can reach.

    Raises:
        InputError: naming the key.
    """
    no_plan = "0" * 12  # stands for the plan of a program that no plan holds
    check_surroundings(cell)
    _check_home(cell)
    home = JointMove(tuple(float(v) for v in np.rad2deg(cell.home)), 10.0, 50.0, 5.0)
    body: list[Instruction] = [home]
    if cell.gauge.ball_to_centre(cell, cell.home) is not None:
        body.append(Centre(1, 1))
    body += preparation(cell, FIRST_MOUNTING)
    for name in dialects:
        try:
            write_session(cell, build_program(cell, no_plan, [*body, home]), name, cell.robot.name)
        except InputError as err:
            raise InputError(f"{cell.path}: the program in '{name}' cannot be written: {err}") from err


def _check_home(cell: Cell) -> None:
    robot = cell.robot
    off = np.flatnonzero((cell.home < robot.q_lower) | (cell.home > robot.q_upper))
    if len(off):
        key = "home_mm" if robot.slides[off[0]] else "home_deg"
        raise InputError(f"{cell.path}: {key} lies beyond the limit of joint {off[0] + 1}")
