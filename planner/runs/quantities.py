"""Joint angles and gauge readings of a table: all columns or none, and values that their unit allows."""

import numpy as np

from planner.common.errors import InputError
from planner.common.units import TURN, Array, read_only, to_deg
from planner.runs.images import PIXEL
from planner.runs.joint_motion import DENSE_STEP
from planner.runs.probe_turns import QUATERNION, rotations_of
from planner.runs.run import Readings, column_of, scalar_kinds
from planner.runs.table import RunTable
from planner.runs.text import first_row


def joint_angles(table: RunTable, stem: str, n_joints: int) -> Array | None:
    """Return read (``q``) or commanded (``cmd``) angles (n, N) [rad], None where there are none.

    Raises:
        InputError: joints missing, or degrees where radians are said.
    """
    q = table.joints(stem, n_joints)
    if q is None:
        return None
    for joint, angle in enumerate(q.T, start=1):
        key, row = f"{stem}{joint}", first_row(np.abs(angle) > 2.0 * TURN)
        if table.units.get(key) == "rad" and row is not None:
            hint = f"if the angles are degrees, call the column {key}_deg"
            raise table.source.error(row, key, f"{angle[row]:g} rad is more than two turns; {hint}")
    return q


def check_jumps(table: RunTable, n_joints: int) -> None:
    """Check that no joint jumps between samples that follow each other closely: it cannot, but a wrapped angle does.

    Raises:
        InputError: with the line where an angle changes by more than half a turn within `DENSE`.
    """
    t = table.array("t")
    close = np.abs(np.diff(t)) < DENSE_STEP
    if table.has("session"):
        close &= np.diff(table.array("session")) == 0.0
    turning = [joint for joint in range(1, n_joints + 1) if joint not in table.slides]
    keys = [f"{stem}{joint}" for stem in ("q", "cmd") for joint in turning]
    for key in filter(table.has, keys):
        q = table.array(key)
        if (row := first_row((np.abs(np.diff(q)) > np.pi) & close)) is not None:
            jump = f"from {to_deg(q[row]):.6g} to {to_deg(q[row + 1]):.6g} degrees within {t[row + 1] - t[row]:.3g} s"
            hint = "angles that are wrapped at a full turn have to run on"
            raise table.source.error(row + 1, key, f"the angle jumps {jump}; {hint}")


POSITION = ("x", "y", "z")
TURNING = ("rx", "ry", "rz")
OFFSET = ("dx", "dy", "dz")
KINDS = {"length": "length_mm", "x": "x_mm, y_mm, z_mm", "ball": "ball", "u": "corner, u_px, v_px"}


QUATERNION_KEYS = ("qx", "qy", "qz", "qw")


def turns_as(table: RunTable) -> str:
    """Return how the columns say that a probe is turned, empty where they do not say it.

    Raises:
        InputError: rx, ry and rz say different conventions.
    """
    if table.has(QUATERNION_KEYS[0]):
        return QUATERNION
    said = {table.units.get(key, "").rpartition("_")[0] for key in TURNING if table.has(key)}
    if len(said) > 1:
        raise InputError(f"{table.source.file}: rx, ry, rz say different conventions: {', '.join(sorted(said))}")
    return said.pop() if said else ""


def _turns_of(table: RunTable, lacking: str) -> Array | None:
    """Return rx, ry, rz (n, 3) [rad], or quaternions x, y, z, w (n, 4) of the length 1, where there are any.

    Raises:
        InputError: both are there, a part of them is, or a quaternion has another length.
    """
    rounding = 1e-2  # of a quaternion's length, as it is written with few digits
    turning, quaternion = (table.group(keys, lacking) for keys in (TURNING, QUATERNION_KEYS))
    if quaternion is None:
        return turning
    if turning is not None:
        raise InputError(
            f"{table.source.file}: rx, ry, rz and a quaternion both say how the probe is turned; keep one of them"
        )
    length = np.linalg.norm(quaternion, axis=1)
    if (row := first_row(np.abs(length - 1.0) > rounding)) is not None:
        found = f"the quaternion has the length {length[row]:.4g}, and those of turns have 1"
        raise table.source.error(row, "qw", found)
    return quaternion


def has_reading(table: RunTable) -> bool:
    """Return whether a table holds any part of a reading."""
    return any(table.has(key) for key in ("length", *POSITION, "ball", *PIXEL, *scalar_kinds()))


def readings_of(table: RunTable, pixels: Array | None = None) -> tuple[Readings, tuple[str, ...]]:
    """Return the readings of a run and the names of its sockets; ``pixels`` (n, K, 2) [px] where it is made of images.

    Raises:
        InputError: no reading, several kinds of it, or a part of one.
    """
    file = table.source.file
    lacking = "there is no column {} beside the others"
    position, offset = (table.group(keys, lacking) for keys in (POSITION, OFFSET))
    turning = _turns_of(table, lacking)
    kinds = KINDS | {key: column_of(kind) for key, kind in scalar_kinds().items()}
    found = [columns for key, columns in kinds.items() if table.has(key) or (key == "u" and pixels is not None)]
    if not found:
        known = "; ".join(kinds.values())
        raise InputError(
            f"{file}: there is no reading; one of {known} is needed beside the joint angles; "
            "titles of your own ('Länge [cm]') are read with --map"
        )
    if len(found) > 1:
        raise InputError(
            f"{file}: there are several readings ({'; '.join(found)}), but a run has one; give each its own file"
        )
    if turning is not None and position is None:
        raise InputError(f"{file}: rx, ry, rz turn with a position, but there is no {KINDS['x']}")
    if offset is not None and not table.has("ball"):
        raise InputError(f"{file}: dx, dy, dz are from a ball's centre, but there is no column ball")
    if pixels is not None:
        return Readings(pixels=pixels), ()
    if table.has("ball"):
        index, names = table.names("ball")
        return Readings(ball=index, offset=offset), names
    if position is not None:
        rotation = None if turning is None else read_only(rotations_of(turning, turns_as(table) or "moving"))
        return Readings(position=position, rotation=rotation, turns=turning), ()
    for key, kind in scalar_kinds().items():
        if table.has(key):
            return kind(scalar=table.optional_column(key)), ()
    return Readings(length=table.optional_column("length")), ()
