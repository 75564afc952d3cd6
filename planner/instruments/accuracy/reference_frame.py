"""The tracker's frame from nests that were measured beforehand, and the errors that even a perfect model would show."""

from dataclasses import dataclass

import numpy as np

from planner.cell.cell import Cell
from planner.cell.places import nests_frame
from planner.common.errors import InputError
from planner.common.units import UM, Array, to_mm
from planner.gauges.placement.frames import are_collinear
from planner.identification.calibrated_robot import CalibratedRobot
from planner.kinematics.geometry import registration, skew
from planner.kinematics.robot import Robot
from planner.model.model import Model
from planner.runs.run import Run

FEWEST_NESTS = 3
NEST_TOLERANCE = 100 * UM  # [m] by which a nest may miss its place after the frame was found


@dataclass(frozen=True)
class NestFrame:
    """Where the nests' frame W stands in the robot's base: R_BW (3, 3), p_BW (3,) [m]."""

    R_BW: Array
    p_BW: Array


@dataclass(frozen=True)
class TrackerRegistration:
    """Where the tracker's frame G stands in the nests' frame W: R_WG (3, 3), p_WG (3,) [m].

    ``misses`` (k,) [m] is what is left at each nest, ``p_WN`` (k, 3) [m] where they are.
    """

    R_WG: Array
    p_WG: Array
    misses: Array
    p_WN: Array

    def to_nests(self, p_GM: Array) -> Array:
        """Bring points (n, 3) [m] from the tracker's frame to the nests'."""
        return np.asarray(p_GM @ self.R_WG.T + self.p_WG)


def nest_frame(cell: Cell) -> NestFrame:
    """Return where the nests' frame stands as the cell says: with the artifact, or on the base without one."""
    return NestFrame(*nests_frame(cell.file))


def register_tracker(cell: Cell) -> TrackerRegistration:
    """Find the tracker's frame from the cell's nests.

    Raises:
        InputError: fewer than three nests were read, they lie on a line, or one is not where it should be.
    """
    read = [n for n in cell.nests if n.p_GN is not None]
    if len(read) < FEWEST_NESTS:
        missing = [n.name for n in cell.nests if n.p_GN is None]
        which = f"read_mm is missing for {', '.join(missing)}" if missing else f"it has {len(read)} of them"
        raise InputError(
            f"{cell.path}: the tracker's frame takes {FEWEST_NESTS} nests in [[tracker.nests]]; {which}, and so is a"
            " line '# nest_mm: NAME, x, y, z' for each above the columns of the run"
        )
    W, G = np.array([n.p_WN for n in read]), np.array([n.p_GN for n in read])
    if are_collinear(W):
        raise InputError(f"{cell.path}: the nests lie nearly on one line, about which the tracker's frame stays open")
    R, p = registration(W, G, np.ones(len(W)))
    misses = np.linalg.norm(G @ R.T + p - W, axis=1)
    if misses.max() > NEST_TOLERANCE:
        metres = " (their readings look like metres)" if np.ptp(G, axis=0).max() < np.ptp(W, axis=0).max() / 500 else ""
        raise InputError(
            f"{cell.path}: the nests miss their places by up to {float(to_mm(misses.max())):.3f} mm{metres}, with the"
            f" tracker's frame as it fits best, and {float(to_mm(NEST_TOLERANCE)):g} mm are allowed: read them again,"
            " look whether two were exchanged, or check their position_mm"
        )
    return TrackerRegistration(R, p, misses, W)


def position_errors(robot: Robot, p_FM: Array, stand: NestFrame, frame: TrackerRegistration, run: Run) -> Array:
    """Return where the tracker saw the tool less where the robot's model has it, in the base frame, (n, 3) [m].

    Args:
        robot: nominal or calibrated; before and after differ in nothing else but ``stand``.
        p_FM: the reflector in the flange, (3,) [m].
        stand: where the nests' frame stands in this robot's base; a calibration on the artifact finds it.
        frame: of the tracker.
        run: positions, read in the tracker's own frame.

    Raises:
        InputError: the run has no positions.
    """
    if run.readings.position is None:
        raise InputError(f"{run.name}: a validation needs the tracker's x_mm, y_mm, z_mm")
    p_BF, R_BF = CalibratedRobot(robot).flange(run.samples.q)
    model = p_BF + R_BF @ p_FM
    seen = frame.to_nests(run.readings.position) @ stand.R_BW.T + stand.p_BW
    return np.asarray(seen - model)


@dataclass(frozen=True)
class ErrorFloor:
    """Root mean square distances over the poses [m], as declared: by the nests, by the tracker, by the arm."""

    nests: float
    tracker: float
    arm: float

    @property
    def all(self) -> float:
        """All three together [m]."""
        return float(np.sqrt(self.nests**2 + self.tracker**2 + self.arm**2))

    def text(self) -> str:
        """Say it in a sentence."""
        whole, nests, tracker, arm = (float(to_mm(v)) for v in (self.all, self.nests, self.tracker, self.arm))
        first = f"{nests:.3f} by the nests' readings, " if nests else ""
        return (
            f"{whole:.3f} mm rms is what a perfect model would show: {first}{tracker:.3f} by the tracker's noise, "
            f"{arm:.3f} by the arm's repeatability"
        )


def error_floor(cell: Cell, run: Run, frame: TrackerRegistration, by_nests: bool = True) -> ErrorFloor:
    """Work it out for the poses of a run with positions; without ``by_nests`` the model stands by no nest."""
    assert run.readings.position is not None
    noise = Model.from_cell(cell).reading_noise(run.samples)
    nests = frame_uncertainty(frame, frame.to_nests(run.readings.position), cell.gauge.noise)
    return ErrorFloor(
        float(np.sqrt((nests**2).mean())) * by_nests,
        float(np.sqrt(noise.gauge_variance.sum())),
        float(np.sqrt(noise.robot_variance.sum(axis=1).mean())),
    )


def frame_uncertainty(frame: TrackerRegistration, p_WM: Array, noise: float) -> Array:
    """Root mean square distance (n,) [m] by which nests read with ``noise`` [m] put points p_WM (n, 3) wrongly."""
    own = _rigid_jacobian(frame.p_WN).reshape(-1, 6)
    rows = _rigid_jacobian(p_WM)
    covariance = noise**2 * np.linalg.inv(own.T @ own)
    return np.asarray(np.sqrt(np.einsum("nij,jk,nik->n", rows, covariance, rows)))


def _rigid_jacobian(p: Array) -> Array:
    """How points (n, 3) move with a small shift and turn of their frame, (n, 3, 6)."""
    return np.concatenate([np.broadcast_to(np.eye(3), (len(p), 3, 3)), -skew(p)], axis=2)
