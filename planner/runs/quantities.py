"""Joint angles and gauge readings of a table: all columns or none, and values that their unit allows."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError
from planner.common.units import Array, read_only, to_deg
from planner.runs.columns import spellings
from planner.runs.joint_motion import DENSE
from planner.runs.run import IntArray, Readings
from planner.runs.table import RunTable

TURN = 2.0 * np.pi


def joint_array(table: RunTable, stem: str, n_joints: int) -> Array | None:
    """Return the columns of a quantity of joints (n, N), or ``None`` where there is none.

    Raises:
        InputError: some joints have it and some have not.
    """
    keys = [f"{stem}{joint}" for joint in range(1, n_joints + 1)]
    missing = [key for key in keys if not table.has(key)]
    if len(missing) == n_joints:
        return None
    if missing:
        names = ", ".join(spellings(key) for key in missing)
        raise InputError(f"{table.source.file}: the robot has {n_joints} joints, but there is no column {names}")
    return table.arrays(keys)


def joint_angles(table: RunTable, stem: str, n_joints: int) -> tuple[Array | None, list[str]]:
    """Return read (``q``) or commanded (``cmd``) angles (n, N) [rad], and what looks odd about them.

    Raises:
        InputError: joints missing, degrees where radians are said, or radians where degrees are said.
    """
    q = joint_array(table, stem, n_joints)
    if q is None:
        return None, []
    _too_far(table, stem, q)
    return q, _radians_as_degrees(table, stem, q)


def _too_far(table: RunTable, stem: str, q: Array) -> None:
    """Refuse columns in radians that hold more than two turns."""
    units = dict(table.units)
    for joint, column in enumerate(q.T, start=1):
        key = f"{stem}{joint}"
        far = np.abs(column) > 2.0 * TURN
        if units.get(key) == "rad" and far.any():
            row = int(np.argmax(far))
            raise InputError(
                f"{table.source.at(row)}, column '{table.source.header(key)}': {column[row]:g} rad is more than two "
                f"turns; if the angles are degrees, call the column {key}_deg"
            )


def _radians_as_degrees(table: RunTable, stem: str, q: Array) -> list[str]:
    """Refuse columns in degrees that move like radians do; warn where they do not move enough to tell.

    An arm that measures moves by tens of degrees: all joints within ±6.3 and moving more than 1 there are in radians.
    """
    units = dict(table.units)
    in_degrees = [j for j in range(q.shape[1]) if units.get(f"{stem}{j + 1}") == "deg"]
    degrees = to_deg(q[:, in_degrees])
    if degrees.size == 0 or np.abs(degrees).max() > TURN + 0.01 or table.note("angles") == "degrees":
        return []
    spread = float(np.ptp(degrees, axis=0).max())
    name = f"{table.source.header(f'{stem}{in_degrees[0] + 1}')} …"
    if spread > 1.0 and len(degrees) > 1:
        raise InputError(
            f"{table.source.file}: the columns {name} are called degrees, but all joints stay within "
            f"±{np.abs(degrees).max():.3g}: radians look like that; call them {stem}1_rad …, or write "
            "'# angles: degrees' above if the arm really moved so little"
        )
    return [
        f"{table.source.name}: no joint moves by more than {spread:.3g} degrees ({name}); "
        f"if these are radians, call them {stem}1_rad"
    ]


def check_jumps(table: RunTable, n_joints: int) -> None:
    """Check that no joint jumps between samples that follow each other closely: it cannot, but a wrapped angle does.

    Raises:
        InputError: with the line where an angle changes by more than half a turn within `DENSE`.
    """
    t = table.array("t")
    close = np.abs(np.diff(t)) < DENSE
    if table.has("session"):
        close &= np.diff(table.array("session")) == 0.0
    for key in (f"{stem}{joint}" for stem in ("q", "cmd") for joint in range(1, n_joints + 1)):
        if not table.has(key):
            continue
        jumps = np.flatnonzero((np.abs(np.diff(table.array(key))) > np.pi) & close)
        if len(jumps):
            row = int(jumps[0]) + 1
            before, after = to_deg(table.array(key)[row - 1 : row + 1])
            raise InputError(
                f"{table.source.at(row)}, column '{table.source.header(key)}': the angle jumps from {before:.6g} to "
                f"{after:.6g} degrees within {t[row] - t[row - 1]:.3g} s; "
                "angles that are wrapped at a full turn have to run on"
            )


POSITION = ("x", "y", "z")
TURNING = ("rx", "ry", "rz")
OFFSET = ("dx", "dy", "dz")
KINDS = {"length": "length_mm", "x": "x_mm, y_mm, z_mm", "ball": "ball"}


def reading_kind(readings: Readings) -> str:
    """Return ``"length"``, ``"position"`` or ``"ball"``."""
    if readings.length is not None:
        return "length"
    return "position" if readings.position is not None else "ball"


def has_reading(table: RunTable) -> bool:
    """Return whether a table holds any part of a reading."""
    return any(table.has(key) for key in ("length", *POSITION, "ball"))


def readings_of(table: RunTable) -> tuple[Readings, tuple[str, ...]]:
    """Return what the gauge read, and the names of the sockets.

    Raises:
        InputError: no reading, several kinds of it, or a part of one.
    """
    file = table.source.file
    position, turning, offset = (_triple(table, keys) for keys in (POSITION, TURNING, OFFSET))
    found = [
        name
        for name, key in ((KINDS["length"], "length"), (KINDS["x"], "x"), (KINDS["ball"], "ball"))
        if table.has(key)
    ]
    if not found:
        raise InputError(
            f"{file}: there is no reading; one of {'; '.join(KINDS.values())} is needed beside the joint angles"
        )
    if len(found) > 1:
        raise InputError(
            f"{file}: there are several readings ({'; '.join(found)}), but a run has one; give each its own file"
        )
    if turning is not None and position is None:
        raise InputError(f"{file}: rx, ry, rz turn with a position, but there is no {KINDS['x']}")
    if offset is not None and not table.has("ball"):
        raise InputError(f"{file}: dx, dy, dz are from a ball's centre, but there is no column ball")
    if table.has("ball"):
        index, names = index_names(table.frame["ball"].to_list())
        return Readings(ball=index, offset=offset), names
    if position is not None:
        rotation = None if turning is None else read_only(Rotation.from_euler("XYZ", turning).as_matrix())
        return Readings(position=position, rotation=rotation), ()
    return Readings(length=read_only(table.array("length"))), ()


def _triple(table: RunTable, keys: Sequence[str]) -> Array | None:
    """Return three columns (n, 3) or ``None``; two of them are an error."""
    missing = [key for key in keys if not table.has(key)]
    if len(missing) == len(keys):
        return None
    if missing:
        raise InputError(
            f"{table.source.file}: there is no column {', '.join(spellings(k) for k in missing)} beside the others"
        )
    return read_only(table.arrays(keys))


def index_names(values: Sequence[str]) -> tuple[IntArray, tuple[str, ...]]:
    """Return the index of each name (n,) in the sorted names (numbers by value), and these."""
    names = sorted_names(set(values))
    place = {name: i for i, name in enumerate(names)}
    index = np.fromiter((place[v] for v in values), dtype=np.int64, count=len(values))
    index.setflags(write=False)
    return index, names


def sorted_names(names: set[str]) -> tuple[str, ...]:
    """Return names in an order of their own: whole numbers by value, then the others by letters."""
    return tuple(sorted(names, key=lambda n: (0, int(n), n) if n.lstrip("-").isdecimal() else (1, 0, n)))
