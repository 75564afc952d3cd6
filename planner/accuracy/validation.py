"""A validation by a tracker: errors of the data sheet's robot and of the calibrated one at poses that neither saw."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.accuracy.arms import Arm, calibrated_arm, nominal_arm
from planner.accuracy.figures import Figures, figures
from planner.accuracy.floor import Floor, floor_of
from planner.accuracy.tracker import Registered, errors_of, registered
from planner.cell import Cell
from planner.errors import InputError, nearest
from planner.run import Run
from planner.run.beside import Beside
from planner.units import MM, Array, frozen

FEWEST = 10  # poses
FAR = 200 * MM  # mean error that no robot has, its place in the cell a little wrong
SURE = 100  # poses below which the outer percentiles say little


@dataclass(frozen=True)
class Judged:
    """One robot model against the tracker: errors seen − model in the base frame (n, 3) [m], and their figures."""

    arm: Arm
    error: Array
    figures: Figures


@dataclass(frozen=True)
class Validation:
    """What a tracker's run says.

    Attributes:
        run: the validation poses alone.
        nests: names of the nests that gave the frame.
        frame: of the tracker.
        before: the robot of the data sheet.
        after: the calibrated one, where there is one.
        floor: what even a perfect model would show.
        notes: what a person should know.
    """

    run: Run
    nests: tuple[str, ...]
    frame: Registered
    before: Judged
    after: Judged | None
    floor: Floor
    notes: tuple[str, ...]


def validated(cell: Cell, run: Run, said: Beside, model: Path | None = None, others: Run | None = None) -> Validation:
    """Judge the robot at the poses of a tracker's run; the frame comes from the nests alone.

    ``others`` are poses of the same run that nothing is judged by: they place a calibrated robot whose own gauge stood
    elsewhere.

    Raises:
        InputError: no or bad nests, too few poses, another gauge, another robot.
        NoSolutionError: the other poses cannot place the robot.
    """
    if run.readings.position is None:
        raise InputError(f"{run.name}: a validation needs the tracker's x_mm, y_mm, z_mm")
    if len(run) < FEWEST:
        raise InputError(f"{run.name}: {len(run)} poses are too few to judge a robot by; at least {FEWEST} are needed")
    if len(run.places) > 1:
        raise InputError(
            f"{run.name}: the tracker stood at {len(run.places)} places ({', '.join(run.places)}), each with nests of "
            "its own: judge them one by one"
        )
    cell, notes = with_nests(cell, said)
    frame = registered(cell)
    after = None if model is None else _judged(calibrated_arm(cell, model, frame, others), frame, run)
    if len(run) < SURE:
        notes.append(f"{len(run)} poses: what 95 and 99 % of them stay within is known roughly")
    if after is not None:
        notes += after.arm.notes
    read = tuple(n.name for n in cell.nests if n.p_GN is not None)
    before = _judged(nominal_arm(cell), frame, run)
    _check_far(run, before)
    floor = floor_of(cell, run, frame, (after or before).arm.by_nests)
    return Validation(run, read, frame, before, after, floor, tuple(notes))


def _check_far(run: Run, before: Judged) -> None:
    if before.figures.mean > FAR:
        raise InputError(
            f"{run.name}: the robot of the data sheet would be {before.figures.mean / MM:.0f} mm off on average, and "
            "none is: look whether two nests were exchanged, whether they and the poses were read in one frame and "
            "in millimetres, and where [artifact] stands"
        )


def with_nests(cell: Cell, said: Beside) -> tuple[Cell, list[str]]:
    """Return the cell with the nests as the run's file has them, and what to say of that.

    Raises:
        InputError: the file names a nest that the cell does not have, or one twice.
    """
    known = [n.name for n in cell.nests]
    read = dict(said.nests)
    for name in read:
        if name not in known:
            raise InputError(
                f"nest '{name}' of the run is not in {cell.path}{nearest(name, known)} (there: {', '.join(known)})"
            )
    if len(read) < len(said.nests):
        raise InputError(f"a nest is read twice above the columns of the run ({', '.join(n for n, _ in said.nests)})")
    both = [n.name for n in cell.nests if n.p_GN is not None and n.name in read]
    notes = [f"nests {', '.join(both)}: as read in the run, not as in {cell.path.name}"] if both else []
    return replace(cell, nests=tuple(replace(n, p_GN=read.get(n.name, n.p_GN)) for n in cell.nests)), notes


def _judged(arm: Arm, frame: Registered, run: Run) -> Judged:
    error = errors_of(arm.robot, arm.p_FM, arm.stand, frame, run)
    return Judged(arm, frozen(np.array(error)), figures(error))
