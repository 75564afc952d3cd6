"""A tracker's run against a robot: its frame comes from nests that were measured beforehand, never from the run.

A frame that is fitted to the validation poses takes up a part of the error that it should show (TriCal paper, 6).
"""

from dataclasses import dataclass

import numpy as np

from planner.calibrated import CalibratedRobot
from planner.cell import Cell
from planner.cell.placed import in_line, nests_frame
from planner.errors import InputError
from planner.placing.rotations import registration
from planner.robot import Robot
from planner.run import Run
from planner.units import UM, Array, to_mm

NESTS = 3
CLOSE = 100 * UM  # [m] by which a nest may miss its place after the frame was found


@dataclass(frozen=True)
class Stand:
    """Where the nests' frame W stands in the robot's base: R_BW (3, 3), p_BW (3,) [m]."""

    R_BW: Array
    p_BW: Array


@dataclass(frozen=True)
class Registered:
    """Where the tracker's frame G stands in the nests' frame W: R_WG (3, 3), p_WG (3,) [m].

    ``misses`` (k,) [m] is what is left at each nest, ``p_WN`` (k, 3) [m] where they are.
    """

    R_WG: Array
    p_WG: Array
    misses: Array
    p_WN: Array

    def seen(self, p_GM: Array) -> Array:
        """Bring points (n, 3) [m] from the tracker's frame to the nests'."""
        return np.asarray(p_GM @ self.R_WG.T + self.p_WG)


def stand_of(cell: Cell) -> Stand:
    """Return where the nests' frame stands as the cell says: with the artifact, or on the base without one."""
    return Stand(*nests_frame(cell.file))


def registered(cell: Cell) -> Registered:
    """Find the tracker's frame from the cell's nests.

    Raises:
        InputError: fewer than three nests were read, they lie on a line, or one is not where it should be.
    """
    read = [n for n in cell.nests if n.p_GN is not None]
    if len(read) < NESTS:
        missing = [n.name for n in cell.nests if n.p_GN is None]
        which = f"read_mm is missing for {', '.join(missing)}" if missing else f"it has {len(read)} of them"
        raise InputError(
            f"{cell.path}: the tracker's frame takes {NESTS} nests in [[tracker.nests]]; {which}, and so is a line "
            "'# nest_mm: NAME, x, y, z' for each above the columns of the run"
        )
    W, G = np.array([n.p_WN for n in read]), np.array([n.p_GN for n in read])
    if in_line(W):
        raise InputError(f"{cell.path}: the nests lie nearly on one line, about which the tracker's frame stays open")
    R, p = registration(W, G, np.ones(len(W)))
    misses = np.linalg.norm(G @ R.T + p - W, axis=1)
    if misses.max() > CLOSE:
        metres = " (their readings look like metres)" if np.ptp(G, axis=0).max() < np.ptp(W, axis=0).max() / 500 else ""
        raise InputError(
            f"{cell.path}: the nests miss their places by up to {float(to_mm(misses.max())):.3f} mm{metres}, with the "
            f"tracker's frame as it fits best, and {float(to_mm(CLOSE)):g} mm are allowed: read them again, look "
            "whether two were exchanged, or check their position_mm"
        )
    return Registered(R, p, misses, W)


def errors_of(robot: Robot, p_FM: Array, stand: Stand, frame: Registered, run: Run) -> Array:
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
    seen = frame.seen(run.readings.position) @ stand.R_BW.T + stand.p_BW
    return np.asarray(seen - model)
