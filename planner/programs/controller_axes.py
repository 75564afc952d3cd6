"""A program in the axes of the controller that runs it: neutral programs are in the angles of the robot's model."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from planner.common.errors import InputError, NoSolutionError
from planner.common.units import Array, from_deg, to_deg
from planner.kinematics.axes import MODEL, AxisConvention
from planner.kinematics.robot import Robot
from planner.programs.dialect import Dialect, dialect_names, load_dialect
from planner.programs.instructions import Entry, Instruction, JointMove, Program
from planner.programs.languages.execution import ReadBack
from planner.programs.rendering import axis_names
from planner.programs.verification import ProgramMismatchError


def axis_convention(robot: Robot, dialect: Dialect) -> AxisConvention:
    """Return how a dialect counts the axes: as the robot's controller does or, where it says so, as the model.

    Raises:
        InputError: the robot's file does not say how that controller counts; with the lines to be added.
    """
    if dialect.angles == MODEL:
        return AxisConvention.model_convention(MODEL, robot.q_lower, robot.q_upper, robot.speed)
    return robot.axes_of(dialect.name.partition("+")[0])


def log_axes(robot: Robot, controller: str) -> AxisConvention:
    """Return how the axes of a log or table count: of the ``controller`` with that name, or of the model.

    Raises:
        InputError: no such dialect, or the robot's file does not say how its controller counts.
    """
    if controller == MODEL:
        return AxisConvention.model_convention(MODEL, robot.q_lower, robot.q_upper, robot.speed)
    return axis_convention(robot, load_dialect(controller))


def controller_words(controller: str) -> str:
    """Return the common name of a language's controller: ``Comau PDL2`` for ``pdl2``."""
    return load_dialect(controller).title.partition(" (")[0] if controller in dialect_names() else controller


def in_controller_axes(program: Program, axes: AxisConvention, dialect: Dialect, speed: Array) -> Program:
    """Return a program with every angle as the controller counts it, and percentages of its own full axis speeds.

    Args:
        program: in the angles of the model.
        axes: how the controller counts.
        dialect: whose names its axes have in messages.
        speed: full speeds of the model's joints (N,) [rad/s], of which the program's percentages are.

    Raises:
        NoSolutionError: a move leaves the stroke of one of the controller's axes.
    """
    turned = replace(
        program,
        home_deg=axes.degrees_to_controller(program.home_deg),
        acceleration_deg_s2=_accelerations(program, axes),
        instructions=tuple(_turn_instructions(program, axes, speed)),
        axes=axes,
        pulses_per_deg=_pulses(program, axes, dialect),
        joint_units=_units_of(program, axes, dialect),
    )
    for number, q_deg in enumerate((turned.home_deg, *_places(turned))):
        c = from_deg(q_deg)
        if not axes.is_within(c).all():
            j = int(np.argmin(axes.is_within(c)))
            low, high = to_deg([axes.lower[j], axes.upper[j]])
            unit = turned.unit_of(j)
            where = f"place {number} of the program" if number else "home"
            raise NoSolutionError(
                f"{where} would take {axis_names(dialect)[j]} of the controller to {q_deg[j]:.4f} {unit}, its stroke "
                f"is {low:g} to {high:g} {unit}: an axis that counts with others has a stroke that the limits of "
                f"single joints do not say. Narrow limit_{unit} of the joints that it follows from "
                f"({axes.sentences(axis_names(dialect))[j]})"
            )
    return turned


def _pulses(program: Program, axes: AxisConvention, dialect: Dialect) -> tuple[float, ...]:
    """Return the pulses of a degree of each axis.

    Raises:
        InputError: the language counts in pulses, and the robot's file does not say how many are a degree.
    """
    if dialect.pulses and not axes.pulses_per_deg:
        raise InputError(missing_pulses(program.robot, axes.controller))
    return axes.pulses_per_deg


def missing_pulses(robot: str, controller: str) -> str:
    """Return the sentence about a robot's file that does not say how many pulses are a degree."""
    return (
        f"programs of {controller_words(controller)} count the axes in pulses, and the file of {robot} does not say "
        f"how many are a degree: give pulses_per_deg of every axis under [controllers.{controller}] (jog an axis by a "
        "known angle, read the pulses from the pendant)"
    )


def _units_of(program: Program, axes: AxisConvention, dialect: Dialect) -> tuple[str, ...]:
    """Return the units of the controller's axes; refuse a language whose axes there all turn.

    Raises:
        InputError: an axis that slides has no word.
    """
    if not program.joint_units:
        return ()
    units = tuple(program.joint_units[int(k)] for k in np.abs(axes.matrix).argmax(axis=1))
    first = units.index("mm") + 1
    if dialect.slides_from is None or first < dialect.slides_from:
        starts = {name: load_dialect(name).slides_from for name in dialect_names()}
        able = [name for name, start in starts.items() if start is not None and start <= first]
        raise InputError(
            f"{dialect.title}: axis {first} of {program.robot} slides; programs of this language have axes that turn"
            f"{'' if dialect.slides_from is None else f' up to number {dialect.slides_from - 1}'}: park the joint "
            f"([parked]), or export to one of {', '.join(able)}"
        )
    return units


def _accelerations(program: Program, axes: AxisConvention) -> tuple[float, ...]:
    """Return the limit of each axis of the controller [deg/s²]."""
    limits = program.acceleration_deg_s2
    return tuple(axes.largest(np.array(limits)).tolist()) if limits else ()


def check_model_angles(program: Program, axes: AxisConvention, found: ReadBack, dialect: Dialect) -> None:
    """Hold the angles that a controller reads against the program in the model's angles.

    Raises:
        ProgramMismatchError: a joint would stand elsewhere by more than the printed decimals explain.
    """
    planned = np.array([m.q_deg for m in program.moves])
    read = np.array([axes.degrees_to_model(row) for row in found.joint_path_deg.tolist()])
    room = (np.abs(axes.inverse) * dialect.resolution_deg(axes.pulses_per_deg)).sum(axis=1) + 1e-6
    off = np.abs(read - planned) - room
    if off.max() > 0.0:
        move, j = np.unravel_index(int(off.argmax()), off.shape)
        unit = program.unit_of(int(j))
        raise ProgramMismatchError(
            f"the program is not released: move {move + 1} leads joint {j + 1} to {read[move, j]:.6f} {unit}, "
            f"planned are {planned[move, j]:.6f} {unit}"
        )


def _places(program: Program) -> Iterator[tuple[float, ...]]:
    """Yield every place that a program drives to, the ways to later starts among them."""
    for item in program.instructions:
        for move in item.moves if isinstance(item, Entry) else (item,) if isinstance(item, JointMove) else ():
            yield from (move.q_deg,) if move.via_deg is None else (move.via_deg, move.q_deg)


def _turn_instructions(program: Program, axes: AxisConvention, speed: Array) -> Iterator[Instruction]:
    """Yield the instructions with their angles turned."""
    here = program.home_deg
    for item in program.instructions:
        if isinstance(item, JointMove):
            yield _turn_move(here, item, axes, speed)
            here = item.q_deg
        elif isinstance(item, Entry):
            starts = (item.origin_deg, *(m.q_deg for m in item.moves))
            moves = tuple(_turn_move(start, m, axes, speed) for start, m in zip(starts, item.moves, strict=False))
            yield replace(item, origin_deg=axes.degrees_to_controller(item.origin_deg), moves=moves)
        else:
            yield item


def _turn_move(start_deg: tuple[float, ...], move: JointMove, axes: AxisConvention, speed: Array) -> JointMove:
    return replace(
        move,
        q_deg=axes.degrees_to_controller(move.q_deg),
        via_deg=None if move.via_deg is None else axes.degrees_to_controller(move.via_deg),
        axis_percent=_percent(start_deg, move, axes, speed),
    )


def _percent(start_deg: tuple[float, ...], move: JointMove, axes: AxisConvention, speed: Array) -> float:
    """Return the percentage of the controller's full axis speeds at which the leg takes the time that it takes now.

    The axis that would take longest sets the pace of a joint move; it may be another one than of the model's joints.
    """
    if not axes.is_coupled and np.array_equal(axes.speed, speed):
        return move.axis_percent
    leg = from_deg(np.subtract(move.q_deg, start_deg))
    own = float((np.abs(axes.matrix @ leg) / axes.speed).max())
    models = float((np.abs(leg) / speed).max())
    return min(100.0, move.axis_percent * own / models) if own > 0.0 and models > 0.0 else move.axis_percent
