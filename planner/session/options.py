"""What a person may ask of a plan, and all that is checked of it and of the cell before any planning."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.common.choices import Aim, SelectionMethod, TourOrder
from planner.common.errors import InputError
from planner.motion.collision.surroundings import check_surroundings
from planner.motion.tour.solve import Method, require_concorde
from planner.programs.controller_axes import axes_for
from planner.programs.dialect import load_dialect
from planner.programs.instructions import Centre, Instruction, JointMove
from planner.runs.run import FIRST_MOUNTING
from planner.session.neutral_program import build_program, preparation, write_session

ANY_ROBOT = "poses-csv"
"""Written where neither the cell nor the robot names a language: a list that anybody can read."""


@dataclass(frozen=True)
class PlanOptions:
    """What the command line may change; ``None`` leaves it to the cell."""

    poses: int | None = None
    index: str | None = None
    seed: int = 0
    dialects: tuple[str, ...] = ()
    tsp: Method = "auto"
    separate: Path | None = None
    fixtures: int | None = None
    aim: Aim | None = None
    method: SelectionMethod | None = None
    order: TourOrder | None = None

    def in_order(self, cell: Cell) -> Cell:
        """Return the cell with the order of the poses that is asked for, in its file as well."""
        if self.order is None:
            return cell
        asked = cell.file.motion.model_copy(update={"order": self.order, "tour_cost": None})
        file = cell.file.model_copy(update={"motion": asked})
        return replace(cell, file=file, motion=replace(cell.motion, order=self.order))

    def for_tracing(self, cell: Cell) -> bool:
        """Tell whether the poses are to show what nobody has declared: where nothing else is asked for, they are.

        Raises:
            InputError: they are to tell rivals apart as well, or an index is to select them by some method.
        """
        asked = self.aim or self.method
        aim, method = (self.aim, self.method) if asked else (cell.plan.aim, cell.plan.method)
        if self.separate and self.method:
            raise InputError(f"{cell.path}: --separate chooses the poses, and so does --method: leave one out")
        if aim is None:
            return not (self.separate or self.index or self.poses or cell.plan.poses or method)
        wanted = aim == "tracing"
        if wanted and method:
            raise InputError(
                f"{cell.path}: the method '{method}' chooses the poses by an index, the aim 'tracing' by the error "
                "that is left: leave one out"
            )
        if wanted and self.separate:
            raise InputError(f"{cell.path}: --separate chooses the poses, and so does the aim 'tracing': leave one out")
        return wanted

    def known_dialects(self, cell: Cell) -> tuple[str, ...]:
        """The dialects to write; what is wrong with them, the cell or the solver is told before a minute's work.

        Raises:
            InputError: there is no such dialect, the robot's file does not say how its controller counts the axes, or
                the cell is wrong (see :mod:`planner.session.options`).
            MissingProgramError: Concorde was asked for and is not there.
        """
        if self.tsp == "concorde":
            _ = require_concorde()
        dialects = self.dialects or cell.controller.dialects or (cell.robot.dialect or ANY_ROBOT,)
        for name in dialects:
            _ = axes_for(cell.robot, load_dialect(name))
        check_cell(cell, dialects)
        return dialects


def check_circle_options(cell: Cell, options: PlanOptions) -> None:
    """Check that nothing is asked of a circular test that only a choice of poses can give.

    Raises:
        InputError: with the options to leave out.
    """
    names = ("poses", "index", "separate", "fixtures", "aim", "method", "order")
    given = ", ".join(f"--{name}" for name in names if getattr(options, name) is not None)
    if given:
        raise InputError(f"{cell.path}: a circular test has no poses to be chosen; leave out {given}")


def check_point_options(cell: Cell, options: PlanOptions) -> None:
    """Check that nothing is asked of a plan for balls or a tracker that only the poses of a bar can give.

    Raises:
        InputError: with the option to leave out.
    """
    if cell.gauge.at_balls and (options.method or cell.plan.method) == "pruning":
        raise InputError(
            f"{cell.path}: pruning keeps the poses of any ball, and each ball is to have as many: leave the method out"
        )
    here = f"the gauge here is '{cell.gauge.kind}'; leave it out"
    if options.fixtures is not None:
        raise InputError(f"{cell.path}: --fixtures is for a bar, {here}")
    if (options.aim or cell.plan.aim) == "tracing":
        raise InputError(f"{cell.path}: the aim 'tracing' is for a bar, {here}")
    if options.separate is not None:
        raise InputError(
            f"{cell.path}: --separate chooses the poses of a bar, {here}, "
            "or measure with a bar what the identification left open"
        )


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
            write_session(cell, build_program(cell, NO_PLAN, [*body, home]), name, cell.robot.name)
        except InputError as err:
            raise InputError(f"{cell.path}: the program in '{name}' cannot be written: {err}") from err


def _check_home(cell: Cell) -> None:
    robot = cell.robot
    off = np.flatnonzero((cell.home < robot.q_lower) | (cell.home > robot.q_upper))
    if len(off):
        raise InputError(f"{cell.path}: home_deg lies beyond the limit of joint {off[0] + 1}")
