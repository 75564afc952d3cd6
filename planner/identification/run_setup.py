"""Where the gauge stands and where the targets sit: as the cell says, or found from the run itself."""

from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell
from planner.cell.setup import MeasurementSetup, setup_of
from planner.common.errors import InputError, did_you_mean
from planner.common.units import MM, Array
from planner.gauges.placement.frames import place_points, place_poses
from planner.gauges.placement.lengths import place_lengths
from planner.gauges.placement.sockets import place_sockets
from planner.runs.joint_motion import joint_speeds, last_reversals
from planner.runs.run import Run, Samples

LOCATED_SIGMA = 20.0 * MM  # one sigma of a frame or tool point that was placed on a robot still millimetres off
REVERSAL_SAMPLES = 600_000  # samples of a run that is not too long to keep every joint's last reversals of
JOINT_MOVED = 1e-3  # [rad] from pose to pose that tell a joint's way
DIRECT_SHARE = 0.98  # share of the logged approaches that agree with the ways from pose to pose
LOCATED_TURN_SIGMA = 0.02  # the same of a frame's orientation [rad]


def run_rig(cell: Cell, run: Run) -> MeasurementSetup:
    """Return the setup of a cell with places and targets numbered as in the run.

    Raises:
        InputError: the run names a place, a ball or a robot that the cell does not have, or another kind of reading.
    """
    _check_kind(cell, run)
    setup = setup_of(cell)
    if setup.kind == "length" and cell.fixtures:
        which = [_index(run, name, setup.place_names, "fixture", cell) for name in run.places]
        setup = replace(
            setup,
            p_BX=setup.p_BX[which],
            place_prior=setup.place_prior[which],
            place_names=tuple(setup.place_names[k] for k in which),
        )
    else:
        n = len(run.places)
        names = run.places if n > 1 or run.readings.ball is None else ("",)  # one plate needs no file's name
        R, p = np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3))
        setup = replace(
            setup,
            place_names=names,
            R_BG=R,
            p_BG=p,
            place_prior=np.full(n, LOCATED_SIGMA),
            turn_prior=LOCATED_TURN_SIGMA,
        )
    if run.balls:
        balls = tuple(b.name for b in cell.balls)
        setup = replace(setup, p_GS=setup.p_GS[[_index(run, name, balls, "ball", cell) for name in run.balls]])
    if run.readings.rotation is not None:
        setup = replace(setup, kind="pose")
    many, named = len(run.points), setup.point_names
    which = [_index(run, name, named, "point", cell) for name in run.points] if len(named) > 1 else [0] * many
    known = cell.tool.known and (many == 1 or len(named) > 1)
    return replace(
        setup,
        point_names=run.points,
        p_FM=setup.p_FM[which],
        R_FM=np.broadcast_to(np.eye(3), (many, 3, 3)),
        tool_prior=setup.tool_prior if known else LOCATED_SIGMA,
    )


def check_pull(cell: Cell, setup: MeasurementSetup, run: Run) -> None:
    """Refuse a loaded bar's run that does not say how much it pulled.

    Raises:
        InputError: where force_N is missing.
    """
    under = sorted(set(setup.loaded) & set(run.places))
    if under and run.samples.force is None and run.readings.length is not None:
        raise InputError(
            f"{run.name}: the column force_N is missing, and at fixture '{under[0]}' of {cell.path} the bar pulls "
            "(circles.loads_N): without it the loads would be taken for errors of the robot"
        )


def locate_gauge(setup: MeasurementSetup, run: Run) -> MeasurementSetup:
    """Return the setup with every frame and target that is not known found from the run, on the robot as it stands.

    Raises:
        InputError, NoSolutionError: the run cannot tell where the gauge stands.
    """
    known = None if setup.tool_prior >= LOCATED_SIGMA else np.asarray(setup.p_FM)
    if setup.kind == "length" and len(setup.p_BX) and known is not None:
        return setup
    p_BF, R_BF = flange_poses(setup, run.samples.q)
    place, point = run.samples.place, run.samples.point
    point = np.zeros(len(run), dtype=int) if point is None else point
    readings = run.readings
    if readings.length is not None:
        bar = place_lengths(p_BF, R_BF, readings.length, place, point, known, setup.p_BX if len(setup.p_BX) else None)
        prior = setup.place_prior if len(setup.p_BX) else np.full(len(bar.p_BX), LOCATED_SIGMA)
        return replace(setup, p_BX=bar.p_BX, p_FM=bar.p_FM, zero=float(np.mean(bar.zero)), place_prior=prior)
    if readings.position is not None and readings.rotation is not None:
        probe = place_poses(p_BF, R_BF, readings.position, readings.rotation, place, point, known)
        return replace(setup, R_BG=probe.R_BG, p_BG=probe.p_BG, p_FM=probe.p_FM, R_FM=probe.R_FM)
    if readings.position is not None:
        seen = place_points(p_BF, R_BF, readings.position, place, point, known)
        return replace(setup, R_BG=seen.R_BG, p_BG=seen.p_BG, p_FM=seen.p_FM)
    assert readings.ball is not None
    plate = place_sockets(p_BF, R_BF, readings.ball, place, point, setup.p_GS, offset=readings.offset, p_FM=known)
    return replace(setup, R_BG=plate.R_BP, p_BG=plate.p_BP, p_FM=plate.p_FM)


def add_motion(run: Run) -> Run:
    """Return the run with the joints' speeds, where they can be told, and the lengths beside the angles."""
    samples = run.samples
    moving = run.continuous and samples.t is not None and len(run) > 2
    speed = joint_speeds(samples) if moving else None
    followed = moving or (not run.continuous and _direct(samples))
    turned = last_reversals(samples.q) if followed and len(run) <= REVERSAL_SAMPLES else None
    return replace(run, samples=replace(samples, speed=speed, length=run.readings.length, reversals=turned))


def _direct(samples: Samples) -> bool:
    """Tell whether the arm went from pose to pose as the rows stand: logged approaches are the ways between them."""
    if samples.direction is None or len(samples) < 3:
        return False
    way = np.diff(samples.q, axis=0)
    told = (np.abs(way) > JOINT_MOVED) & (samples.direction[1:] != 0)
    return bool(told.any() and (np.sign(way) == samples.direction[1:])[told].mean() > DIRECT_SHARE)


def flange_poses(setup: MeasurementSetup, q: Array) -> tuple[Array, Array]:
    """Positions (n, 3) [m] and orientations (n, 3, 3) of the flange of the nominal robot."""
    motion = setup.robot.chain.forward(setup.robot.theta(q))
    return motion.x.T.copy(), motion.R.transpose(2, 0, 1).copy()


def _check_kind(cell: Cell, run: Run) -> None:
    kind, readings = cell.gauge.kind, run.readings
    wanted = {"tracker": "x_mm, y_mm, z_mm", "trical": "ball", "ball-socket": "ball"}.get(kind, "length_mm")
    there = (
        "length_mm" if readings.length is not None else "x_mm, y_mm, z_mm" if readings.position is not None else "ball"
    )
    if wanted != there:
        raise InputError(f"{run.name}: has readings '{there}', but the gauge '{kind}' of {cell.path} gives '{wanted}'")
    _check_range(cell, run)
    if run.robot is not None and run.robot != cell.robot.name:
        raise InputError(
            f"{run.name}: was measured on '{run.robot}', but {cell.path} has the robot '{cell.robot.name}'"
        )
    if readings.ball is not None and not cell.balls:
        raise InputError(f"{cell.path}: a gauge '{kind}' needs [[balls]] with their positions in the plate's frame")


def _check_range(cell: Cell, run: Run) -> None:
    """Refuse lengths, and distances from a ball's centre, in another unit than their column says."""
    if run.readings.offset is not None and cell.gauge.head is not None:
        _check_offsets(run, run.readings.offset, cell.gauge.head.range)
    length, low, high = run.readings.length, cell.gauge.length_min, cell.gauge.length_max
    if length is None or not np.isfinite(high):
        return
    middle, typical = float(np.sqrt(max(low, 1e-3) * high)), float(np.median(np.abs(length)))
    for factor, words in ((1e-3, "metres in a column of millimetres"), (1e3, "millimetres in a column of metres")):
        if 0.2 < typical / (middle * factor) < 5:
            raise InputError(
                f"{run.name}: the lengths are about {typical / MM:.4g} mm, but the bar reaches from {low / MM:g} to "
                f"{high / MM:g} mm: these look like {words}"
            )


def _check_offsets(run: Run, offset: Array, reach: float) -> None:
    far = np.flatnonzero(np.abs(offset).max(axis=1) > reach)
    if len(far):
        found = np.abs(offset[far[0]]).max() / MM
        raise InputError(
            f"{run.where(int(far[0]))}: the ball is {found:.4g} mm off centre, but the indicators "
            f"(gauge.head.range_mm) move by {reach / MM:g} mm in all: are dx_mm, dy_mm, dz_mm in millimetres?"
        )


def _index(run: Run, name: str, known: tuple[str, ...], what: str, cell: Cell) -> int:
    if name in known:
        return known.index(name)
    if name == "" and len(known) == 1:
        return 0
    if name == "":
        raise InputError(
            f"{run.name}: the column '{what}' is missing, and {cell.path} has several ({', '.join(known)})"
        )
    raise InputError(
        f"{run.name}: {what} '{name}' is not in {cell.path}{did_you_mean(name, list(known))} (there:"
        f" {', '.join(known)})"
    )
