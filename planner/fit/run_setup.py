"""Where the gauge stands and where the targets sit: as the cell says, or found from the run itself."""

from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell, MeasurementSetup, setup_of
from planner.cell.file import FIRST_POINT
from planner.common.determinism import even_positions
from planner.common.errors import InputError
from planner.common.units import MM, Array
from planner.gauges.placement.solver import LOCATED_SIGMA, index_in_cell
from planner.runs.joint_motion import joint_speeds, last_reversals
from planner.runs.run import Run, Samples

JOINT_MOVED = 1e-3  # [rad] from pose to pose that tell a joint's way


def setup_for_run(cell: Cell, run: Run) -> MeasurementSetup:
    """Return the measurement set-up of a cell with places and targets numbered as in the run.

    Raises:
        InputError: the run names a place, a ball or a robot that the cell does not have, or another kind of reading.
    """
    cell.gauge.check_run(cell, run)
    _check_limits(cell, run)
    cell.check_robot(run)
    setup = replace(setup_of(cell), gauge=cell.gauge.with_turns(run.readings.rotation is not None))
    setup = cell.gauge.number_places(setup, cell, run)
    many, named = len(run.points), setup.point_names
    known = cell.tool.known and (many == 1 or len(named) > 1)
    there = named if len(named) > 1 else (FIRST_POINT,)
    which = [index_in_cell(run, name, there, "point", cell) for name in run.points] if known else [0] * many
    return replace(
        setup,
        point_names=run.points,
        p_FM=setup.p_FM[which],
        R_FM=np.broadcast_to(np.eye(3), (many, 3, 3)),
        tool_prior=setup.tool_prior if known else LOCATED_SIGMA,
    )


def _check_limits(cell: Cell, run: Run) -> None:
    """Refuse angles that the robot cannot have had.

    Raises:
        InputError: naming the row, the joint and its limits.
    """
    limit_slack = np.deg2rad(2.0)  # that an arm may stand beyond a limit of its file
    robot, q = cell.robot, run.samples.q
    beyond = np.maximum(robot.q_lower - q, q - robot.q_upper)
    rows = np.flatnonzero(beyond.max(axis=1) > limit_slack)
    if not len(rows):
        return
    k = int(rows[0])
    j = int(beyond[k].argmax())
    low, high = np.rad2deg([robot.q_lower[j], robot.q_upper[j]])
    found, unit = robot.joint_text(j, q[k, j], ".6g"), robot.joint_units[j]
    raise InputError(
        f"{run.where(k)}: joint {j + 1} stands at {found}, its limit_{unit} in {robot.path} is "
        f"[{low:.6g}, {high:.6g}] ({len(rows)} of {len(q)} rows have such a joint): are the angles the controller's, "
        "in its order, sense and zero, and are the limits this robot's?"
    )


def drop_unreadable(cell: Cell, run: Run) -> Run:
    """Return the run without the readings that the gauge cannot have made, and a warning that says how many.

    A place at which hardly any could be its own has another bar than the cell's, and is kept.

    Raises:
        InputError: another kind of reading, or hardly any at all could be made with the cell's gauge.
    """
    least = 0.25  # share of the readings at a place that lie within the range of the gauge that stands there
    cell.gauge.check_run(cell, run)
    run = cell.gauge.sift(cell, run)
    good = cell.gauge.tell_readable(run)
    if good.all():
        return run
    low, high = cell.gauge.length_min / MM, cell.gauge.length_max / MM
    reach = f"the range {low:g} to {high:g} mm" if cell.gauge.unit == "mm" else "the range"
    beyond = f"{int((~good).sum())} of {len(run)} {cell.gauge.plural} lie beyond {reach}"
    share = np.bincount(run.samples.place, weights=good) / np.maximum(np.bincount(run.samples.place), 1)
    if share.max() < least:
        raise InputError(
            f"{run.name}: {beyond} of the gauge in {cell.path}: it cannot have read them; check gauge.length_mm, and "
            f"whether the {cell.gauge.noun} was pulled off or its zero was set"
        )
    kept = good | (share[run.samples.place] < least)
    if kept.all():
        return run
    warning = f"{_rows_text(run, ~kept)} beyond {reach}, which the gauge cannot have read"
    warning += " (pulled off, at a stop, or mistyped), and cut out: read again, or correct the file"
    return replace(run.take(kept), warnings=(*run.warnings, warning))


def _rows_text(run: Run, which: np.ndarray) -> str:
    """Name the rows of a mask (n,), the first few of many: file, line, pose."""
    most = 3  # rows that a person is told one by one
    rows = np.flatnonzero(which)
    named = [run.where_at_pose(k) for k in rows[:most]]
    text = " and ".join([", ".join(named[:-1]), named[-1]] if len(named) > 1 else named)
    more = f" and {len(rows) - most} more" if len(rows) > most else ""
    return f"{text}{more} {'is' if len(rows) == 1 else 'are'}"


def check_pull(cell: Cell, setup: MeasurementSetup, run: Run) -> None:
    """Refuse a loaded bar's run without the force of the bar.

    Raises:
        InputError: where force_N is missing.
    """
    under = sorted(set(setup.loaded) & set(run.places))
    if under and run.samples.force is None and run.readings.length is not None:
        raise InputError(
            f"{run.name}: the column force_N is missing, and at fixture '{under[0]}' of {cell.path} the bar pulls "
            f"({setup.loaded[under[0]]}): without it the loads would be taken for errors of the robot"
        )


def locate_gauge(setup: MeasurementSetup, run: Run) -> MeasurementSetup:
    """Return the set-up with unknown frames and targets estimated from the run, on the nominal robot.

    Raises:
        InputError, NoSolutionError: the run cannot tell where the gauge stands.
    """
    known = None if setup.tool_prior >= LOCATED_SIGMA else np.asarray(setup.p_FM)
    return setup.gauge.place(setup, run, known)


def number_samples(run: Run) -> Run:
    """Return the run with how the joints moved, and every sample's number: parts of it then keep what came before."""
    if run.samples.number is not None:
        return run
    run = add_motion(run)
    return replace(run, samples=replace(run.samples, number=np.arange(len(run))))


def spread_rows(run: Run, width: int) -> Run:
    """Return a long run with fewer rows, evenly over all of it; ``width``: numbers in one reading.

    Along a drive neighbours err alike: of hundreds of thousands of rows some thousands are worth one each.
    """
    # 8_000, 24_000: rows and numbers that a fit looks at; 500: rows that it looks at however many numbers one has
    return run.take(even_positions(len(run), max(500, min(8_000, 24_000 // width))))


def add_motion(run: Run) -> Run:
    """Return the run with the joints' speeds, where they can be told, and the lengths beside the angles.

    Of poses at rest without logged approaches the rows are taken for the way that the arm went.
    """
    samples = run.samples
    if samples.number is not None:
        return run
    moving = run.continuous and samples.t is not None and len(run) > 2
    speed = joint_speeds(samples) if moving else None
    followed = moving or (not run.continuous and (samples.direction is None or _went_straight(samples)))
    # 600_000: samples of a run that is not too long to keep every joint's last reversals of
    turned = last_reversals(samples.q) if followed and len(run) <= 600_000 else None
    direction = samples.direction
    if direction is None and not run.continuous:
        direction = directions_by_row(samples)
    changed = replace(samples, speed=speed, length=run.readings.length, reversals=turned, direction=direction)
    return replace(run, samples=changed)


def directions_by_row(samples: Samples) -> Array:
    """Return the sign of each joint's last move (n, N) if the arm went from row to row; 0 where none is known.

    A session begins without any: nobody knows where the arm came from.
    """
    n, session = len(samples), samples.session_numbers
    way = np.diff(samples.q, axis=0, prepend=samples.q[:1])
    way[np.diff(session, prepend=session[:1]) != 0] = 0.0
    way[np.abs(way) <= JOINT_MOVED] = 0.0
    first = np.maximum.accumulate(np.where(np.diff(session, prepend=-1) != 0, np.arange(n), 0))
    last = np.maximum.accumulate(np.where(way != 0, np.arange(n)[:, None], 0))  # row of each joint's last move
    return np.asarray(np.where(last >= first[:, None], np.sign(np.take_along_axis(way, last, axis=0)), 0.0))


def _went_straight(samples: Samples) -> bool:
    """Tell whether the arm went from pose to pose as the rows stand: logged approaches are the ways between them."""
    if samples.direction is None or len(samples) < 3:
        return False
    way = np.diff(samples.q, axis=0)
    told = (np.abs(way) > JOINT_MOVED) & (samples.direction[1:] != 0)
    # 0.98: of the logged approaches agree with the ways from pose to pose
    return bool(told.any() and (np.sign(way) == samples.direction[1:])[told].mean() > 0.98)
