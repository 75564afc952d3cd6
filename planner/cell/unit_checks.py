"""Values that are possible as written, but only make sense in metres or radians: refused before anything is drawn."""

from pathlib import Path

import numpy as np

from planner.cell.file import CellFile
from planner.common.errors import InputError

NEAR_BASE = 10.0  # [mm] a fixture whose coordinates are all smaller would stand inside the robot's base
SHORT_TOOL = 1.0  # [mm] from flange to ball: no ball is that small
SMALL_BALL = 0.5  # [mm] radius
NARROW_CONE = 5.0  # [deg] no ball joint tilts so little, and no bar could be measured with one
QUARTER = np.pi / 4  # robots wait at multiples of 45°
AS_PRINTED = 6e-4  # [rad] what three printed digits leave open


def check_units(path: Path, file: CellFile) -> None:
    """Refuse lengths that look like metres and angles that look like radians; zeros mean zero in any unit.

    Raises:
        InputError: naming the key, what was found and what it would be in the unit that is wanted.
    """
    for f in file.fixtures:
        if max(map(abs, f.position_mm)) < NEAR_BASE:
            _raise_metres(path, f"fixtures.{f.name}.position_mm", f.position_mm, "inside the robot's base")
    _check_placed(path, file)
    points = [(f"tool.points.{p.name}.map_mm", p.map_mm) for p in file.tool.points] if file.tool else []
    for key, point in [*([("tool.map_mm", file.tool.map_mm)] if file.tool else []), *points]:
        if np.linalg.norm(point) < SHORT_TOOL:
            _raise_metres(path, key, point, f"less than {SHORT_TOOL:g} mm from the flange")
    mounts = [(f"fixtures.{f.name}.mount_deg", f.mount_deg) for f in file.fixtures]
    for key, angles in [("home_deg", file.home_deg), ("gauge.mount_deg", file.gauge.mount_deg), *mounts]:
        if angles and _looks_like_radians(angles):
            _raise_radians(path, key, angles)
    for key, cone in (("fixture", file.gauge.cone_deg.fixture), ("map", file.gauge.cone_deg.map)):
        if cone < NARROW_CONE:
            raise InputError(
                f"{path}: 'gauge.cone_deg.{key}' = {cone:g}° is less than a ball joint's {NARROW_CONE:g}°: this looks "
                f"like radians; {cone:g} rad would be {np.rad2deg(cone):.4g}, and the key is in degrees"
            )


def _check_placed(path: Path, file: CellFile) -> None:
    """Refuse an artifact or tracker inside the robot's base, and balls that stand inside one another."""
    for key, placed in (("artifact", file.artifact), ("tracker", file.tracker)):
        if placed is not None and max(map(abs, placed.position_mm)) < NEAR_BASE:
            _raise_metres(path, f"{key}.position_mm", placed.position_mm, "inside the robot's base")
    if len(file.balls) > 1 and np.ptp([b.position_mm for b in file.balls], axis=0).max() < NEAR_BASE:
        last = file.balls[-1]
        _raise_metres(path, f"balls.{last.name}.position_mm", last.position_mm, "inside all the other balls")
    for ball in file.balls:
        if ball.radius_mm < SMALL_BALL:
            _raise_metres(path, f"balls.{ball.name}.radius_mm", (ball.radius_mm,), "smaller than any ball of a gauge")
        if max(map(abs, ball.position_mm)) < SHORT_TOOL:
            _raise_metres(
                path, f"balls.{ball.name}.position_mm", ball.position_mm, f"less than {SHORT_TOOL:g} mm from zero"
            )


def _looks_like_radians(angles: tuple[float, ...]) -> bool:
    """Tell whether all angles are within ±2π and at least half of those not zero are printed multiples of π/4."""
    turned = np.abs([a for a in angles if a != 0.0])
    if not len(turned) or turned.max() > 2 * np.pi + AS_PRINTED:
        return False
    multiple = np.abs(turned - QUARTER * np.maximum(np.round(turned / QUARTER), 1.0)) < AS_PRINTED
    return bool(2 * multiple.sum() >= len(turned))


def _raise_metres(path: Path, key: str, found: tuple[float, ...], where: str) -> None:
    if any(found):
        meant = [float(f"{1e3 * v:.6g}") for v in found]
        raise InputError(
            f"{path}: '{key}' = {list(found)} is {where}: these look like metres; in millimetres they would be {meant}"
        )


def _raise_radians(path: Path, key: str, found: tuple[float, ...]) -> None:
    meant = [float(f"{np.rad2deg(v):.4g}") for v in found]
    raise InputError(
        f"{path}: '{key}' = {list(found)} holds multiples of π/4: these look like radians; "
        f"in degrees they would be {meant}"
    )
