"""Conventions in which orientations of a table may be written, and which of them the joint angles agree with."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from scipy.spatial.transform import Rotation

from planner.common.units import DEG, Array
from planner.compensation.tolerances import CONVENTION_AGREES, SAME

_LETTERS = "ABC"
_INVERSE = "the inverse turn (of the base from the tool)"


@dataclass(frozen=True)
class Convention:
    """A way to read the numbers of an orientation.

    Attributes:
        name: of the way, for a person.
        R: the orientations that the numbers then say, (n, 3, 3).
        cure: what makes the table right.
    """

    name: str
    R: Array
    cure: str


def turns_between(R_one: Array, R_other: Array) -> Array:
    """Return the angles between orientations, (n,) [rad], both (n, 3, 3)."""
    return np.asarray((Rotation.from_matrix(R_one).inv() * Rotation.from_matrix(R_other)).magnitude())


def agreeing_conventions(words: Array, R_wanted: Array) -> list[Convention]:
    """Return the usual conventions by which all orientations are those of the joint angles, the most usual first.

    Args:
        words: the orientations as written, (n, 3) angles [rad] or (n, 4) quaternions, scalar first.
        R_wanted: orientations at the joint angles, (n, 3, 3).
    """
    ways = _of_quaternions(words) if words.shape[1] == 4 else _of_angles(words)
    found: list[Convention] = []
    for way in ways:
        is_new = all(turns_between(way.R, other.R).max() > SAME for other in found)  # not the same by another name
        if is_new and turns_between(way.R, R_wanted).max() < CONVENTION_AGREES:
            found.append(way)
    return found


def turn_of_tool(R: Array, R_wanted: Array) -> Array | None:
    """Return the one turn of the tool (3, 3) by which all orientations (n, 3, 3) agree; None where there is none.

    With orientations that hardly vary any turn would do.
    """
    # 10: [deg] that orientations vary by over a table, else one turn of the tool explains anything
    if turns_between(R_wanted, np.broadcast_to(R_wanted[0], R_wanted.shape)).max() < 10.0 * DEG:
        return None
    mean = Rotation.from_matrix(np.swapaxes(R_wanted, 1, 2) @ R).mean().as_matrix()
    return mean if turns_between(R, R_wanted @ mean).max() < CONVENTION_AGREES else None


def _of_quaternions(wxyz: Array) -> Iterator[Convention]:
    last = "name the columns qx, qy, qz, qw in the order in which they stand"
    scalar_last, scalar_first = Rotation.from_quat(wxyz), Rotation.from_quat(wxyz[:, [1, 2, 3, 0]])
    yield Convention("quaternions x, y, z, w (scalar last)", scalar_last.as_matrix(), last)
    yield Convention(f"{_INVERSE}, w, x, y, z", scalar_first.inv().as_matrix(), "turn the signs of qx, qy, qz")
    yield Convention(
        f"{_INVERSE}, x, y, z, w", scalar_last.inv().as_matrix(), f"{last}, and turn the signs of qx, qy, qz"
    )


def _of_angles(abc: Array) -> Iterator[Convention]:
    """Yield the readings of three angles, in the unit that is said, then in the other one."""
    cure = "convert them to A, B, C (Z-Y'-X\", moving axes)"
    for factor, unit in (
        (1.0, ""),
        (1.0 / DEG, "radians under the name of degrees: "),
        (DEG, "degrees under the name of radians: "),
    ):
        angles = abc * factor
        for name, R in _readings(angles):
            if factor == 1.0 and name == _OWN:
                continue
            exchange = "exchange the names a_deg and c_deg" if name == _FIXED_XYZ else cure
            yield Convention(unit + name, R, exchange if not unit else f"name the unit (a_deg or a_rad); {exchange}")


_OWN = "A, B, C about Z, Y', X\" (moving axes)"
_FIXED_XYZ = "A, B, C about the fixed axes X, Y, Z (roll, pitch, yaw), which is the order C, B, A"


def _readings(angles: Array) -> Iterator[tuple[str, Array]]:
    """Yield every usual reading of three angles (n, 3) [rad]: name, and orientations (n, 3, 3)."""
    axes = ["".join(order) for order in permutations("XYZ")]
    proper = [f"{a}{b}{a}" for a, b in permutations("XYZ", 2)]
    orders = [(0, 1, 2), *(order for order in permutations(range(3)) if order != (0, 1, 2))]
    for columns in orders:
        letters = ", ".join(_LETTERS[k] for k in columns)
        for sequence in ("ZYX", "XYZ", "ZYZ", *axes, *proper):
            about = "{}, {}', {}\" (moving axes)".format(*sequence)
            R = Rotation.from_euler(sequence, angles[:, columns]).as_matrix()
            if columns == (0, 1, 2):
                yield f"{letters} about {about}", R
                fixed = Rotation.from_euler(sequence.lower(), angles).as_matrix()
                name = _FIXED_XYZ if sequence == "XYZ" else f"{letters} about the fixed axes {', '.join(sequence)}"
                yield name, fixed
            elif sequence in axes:
                yield f"{letters} about {about}", R
        if columns == (0, 1, 2):
            yield "a rotation vector (axis times angle)", Rotation.from_rotvec(angles).as_matrix()
            yield _INVERSE, Rotation.from_euler("ZYX", angles).inv().as_matrix()
