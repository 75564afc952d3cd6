"""``box.toml``: the part of the workspace in which the error of the tool counts, an upright box in the base frame."""

from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from planner.cell.site import Site
from planner.common.errors import InputError
from planner.common.schema import StrictModel, read_toml
from planner.common.units import Array, from_mm
from planner.kinematics.bodies import Vector


class RegionFile(StrictModel):
    """The file: opposite corners of the box [mm]."""

    schema_: Literal["edbb-region/1"] = Field(alias="schema")
    lower_mm: Vector
    upper_mm: Vector


def states_in_region(path: Path, site: Site, q: Array) -> Array:
    """Return those of the joint states q (n, N) [rad] in which the first tool point is in the box.

    Raises:
        InputError: no such file, corners that are no box, or a box that the robot hardly reaches.
    """
    box = read_toml(path, RegionFile)
    lower, upper = from_mm(box.lower_mm), from_mm(box.upper_mm)
    if np.any(lower >= upper):
        raise InputError(f"{path}: lower_mm must be less than upper_mm in x, y and z")
    p_BM = site.map_position(q)
    inside = np.all((p_BM >= lower) & (p_BM <= upper), axis=1)
    # 100: joint states in the box, of those that are drawn: with fewer its error is a guess
    if inside.sum() < 100:
        raise InputError(
            f"{path}: the tool point of {site.robot.name} is in this box in {inside.sum()} of {len(q)} states of the "
            "workspace: is it in the base frame, in mm, and large enough?"
        )
    return np.asarray(q[inside])
