"""Numbers that the file of a robot can hold in earnest: a slip of the pen or of the unit is told when it is read.

The bounds are wide of every arm on the market; what they refuse is no arm, or one in other units.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from planner.common.errors import InputError
from planner.common.units import MM, Array, to_deg, to_mm
from planner.kinematics.chain import Transform

PayloadKg = Annotated[float, Field(gt=0, le=5000)]  # the strongest arm of today carries 2300 kg
LinkMassKg = Annotated[float, Field(ge=0, le=20_000)]
ReachMm = Annotated[float, Field(ge=50, le=20_000)]
RepeatabilityMm = Annotated[float, Field(ge=1e-3, le=10)]  # the best arms repeat to 5 µm, toys to a millimetre
REACH_SHARE = (0.3, 1.1)  # of that length: makers state the reach of the wrist's centre from axis 1, 0.58 to 0.77 of it


def check_joint_limits(path: Path, lower: Array, upper: Array, slides: np.ndarray) -> None:
    """Refuse joint limits (N,) [rad] that no arm has; infinite ones are not stated.

    ``slides``: which joints slide, (N,) bool; the limits of these count degrees for millimetres.

    Raises:
        InputError: naming the joint, its limits and what is allowed.
    """
    track_most = 50_000.0  # [mm] of a linear track: 47 m are on the market
    # [deg] beyond which both limits of an axis are alike to this factor: it has no own stop there
    one_sided = (540.0, 2.0)
    for i, limits in enumerate(zip(to_deg(lower), to_deg(upper), strict=True), 1):
        near, far = sorted(map(abs, limits))
        if not np.isfinite(far):
            continue
        if slides[i - 1]:
            if far > track_most:
                raise InputError(
                    f"{path}: joint {i} slides, and has the limits {limits[0]:.6g} mm and {limits[1]:.6g} mm: allowed "
                    f"are {track_most:g} mm to either side"
                )
            continue
        # [deg] the first three axes carry the arm: cables and castings stop them; an end of the wrist may turn
        # several times, some to ±2700°
        most = 400.0 if i - slides[:i].sum() <= 3 else 8 * 360.0
        said = f"{path}: joint {i} has the limits {limits[0]:.6g}° and {limits[1]:.6g}°"
        if far > most:
            raise InputError(f"{said}: allowed are {most:g}° to either side for this axis")
        if far > one_sided[0] and far > one_sided[1] * near:
            raise InputError(
                f"{said}: an axis that turns beyond {one_sided[0]:g}° does so to both sides; is one of them mistyped?"
            )


def check_reach(path: Path, rows: Sequence[Transform], stated_mm: float | None) -> None:
    """Hold the length of the links, and the reach that the file states, against what arms have and one another.

    Raises:
        InputError: with both numbers.
    """
    longest = 20.0  # [m] from base to flange along the links
    shortest = 0.05  # [m] from base to flange along the links
    length = float(sum(abs(t.nominal) for t in rows if t.kind == "translation"))
    if not shortest <= length <= longest:
        raise InputError(
            f"{path}: the links from base to flange add up to {to_mm(length):.6g} mm, arms have {shortest / MM:g} to "
            f"{longest / MM:g} mm: are these lengths in another unit?"
        )
    low, high = (share * length / MM for share in REACH_SHARE)
    if stated_mm is not None and not low <= stated_mm <= high:
        raise InputError(
            f"{path}: reach_mm = {stated_mm:g} does not belong to these links, which add up to {length / MM:.6g} mm "
            f"from base to flange; a reach of {low:.4g} to {high:.4g} mm is allowed"
        )
