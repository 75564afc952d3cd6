"""Joint columns of a table: all joints or none, and angles that can be what their unit says."""

import numpy as np

from planner.errors import InputError
from planner.run.clock import DENSE
from planner.run.columns import spellings
from planner.run.table import Table
from planner.units import Array, to_deg

TURN = 2.0 * np.pi


def joint_array(table: Table, stem: str, n_joints: int) -> Array | None:
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


def angles(table: Table, stem: str, n_joints: int) -> tuple[Array | None, list[str]]:
    """Return read (``q``) or commanded (``cmd``) angles (n, N) [rad], and what looks odd about them.

    Raises:
        InputError: joints missing, degrees where radians are said, or radians where degrees are said.
    """
    q = joint_array(table, stem, n_joints)
    if q is None:
        return None, []
    _too_far(table, stem, q)
    return q, _radians_as_degrees(table, stem, q)


def _too_far(table: Table, stem: str, q: Array) -> None:
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


def _radians_as_degrees(table: Table, stem: str, q: Array) -> list[str]:
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


def check_jumps(table: Table, n_joints: int) -> None:
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
