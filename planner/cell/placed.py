"""What gauges without a bar add to a cell: where artifact or tracker stand, balls, nests and the head of indicators."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from planner.bodies import Body
from planner.cell.file import CellFile
from planner.cell.parts import Ball, Fixture, Head, Nest
from planner.cell.placed_file import HeadFile, PlacedFile
from planner.errors import InputError
from planner.units import MM, Array, from_deg, from_mm, frozen

SQUARE = 1.0  # [deg] by which two indicators may miss a right angle
NESTS = 3
FLAT = 0.05  # share of their spread by which the nests must leave one line


def balls_of(file: CellFile) -> tuple[Ball, ...]:
    """Return the balls of a cell file."""
    return tuple(
        Ball(
            b.name,
            frozen(from_mm(b.position_mm)),
            b.radius_mm * MM,
            None if b.stem_to_mm is None else frozen(from_mm(b.stem_to_mm)),
            b.stem_radius_mm * MM,
        )
        for b in file.balls
    )


def carrier_of(path: Path, file: CellFile) -> tuple[Body, ...]:
    """Return the bodies of the artifact, in its own frame."""
    bodies = () if file.artifact is None else file.artifact.bodies
    return tuple(b.body(f"artifact_{k}", path.parent) for k, b in enumerate(bodies))


def nests_of(file: CellFile) -> tuple[Nest, ...]:
    """Return the nests of a tracker."""
    nests = () if file.tracker is None else file.tracker.nests
    return tuple(
        Nest(n.name, frozen(from_mm(n.position_mm)), None if n.read_mm is None else frozen(from_mm(n.read_mm)))
        for n in nests
    )


def nests_frame(file: CellFile) -> tuple[Array, Array]:
    """Return R (3, 3), p (3,) [m] of the nests' frame in the base frame: the artifact's, or the base's own."""
    if file.artifact is None:
        return frozen(np.eye(3)), frozen(np.zeros(3))
    return frame_of(file.artifact)


def frame_of(placed: PlacedFile) -> tuple[Array, Array]:
    """Return R (3, 3), p (3,) [m] of what a cell places, in the base frame."""
    R = Rotation.from_euler("xyz", from_deg(placed.rpy_deg)).as_matrix()
    return frozen(R), frozen(from_mm(placed.position_mm))


def in_line(p: Array) -> bool:
    """Tell whether points (n, 3) lie nearly on one line."""
    size = np.linalg.svd(p - p.mean(axis=0), compute_uv=False)
    return bool(size[1] < FLAT * size[0])


def place_of(path: Path, file: CellFile) -> Fixture:
    """Return the unnamed place at which the artifact of a head, or a tracker, stands.

    Raises:
        InputError: the section that says so is missing, or what it needs beside it.
    """
    if file.gauge.kind == "trical":
        _check_trical(path, file)
    elif file.tracker is None:
        raise InputError(f"{path}: the section [tracker] with position_mm is missing: where the tracker stands")
    elif 0 < len(file.tracker.nests) < NESTS:
        raise InputError(f"{path}: tracker.nests has {len(file.tracker.nests)} nests; a frame takes {NESTS} of them")
    elif file.tracker.nests and in_line(from_mm([n.position_mm for n in file.tracker.nests])):
        raise InputError(f"{path}: tracker.nests lie nearly on one line, about which the tracker's frame stays open")
    placed: PlacedFile | None = file.artifact if file.gauge.kind == "trical" else file.tracker
    assert placed is not None
    R, p = frame_of(placed)
    return Fixture(
        "",
        p,
        frozen(R[:, 2]),
        placed.prior_mm * MM,
        None,
        R,
        float(from_deg(placed.prior_deg)),
    )


def _check_trical(path: Path, file: CellFile) -> None:
    if file.artifact is None:
        raise InputError(
            f"{path}: the section [artifact] with position_mm is missing: where the balls' frame stands in the base's"
        )
    if not file.balls:
        raise InputError(f"{path}: a head of indicators needs at least one [[balls]] table")
    if file.gauge.head is None:
        raise InputError(
            f"{path}: the section [gauge.head] with indicators is missing: the directions of the three indicators from "
            "the tool point, in the flange frame"
        )
    _check_master(path, file.gauge.head, 2 * file.balls[0].radius_mm)
    names = [b.name for b in file.balls]
    if len(set(names)) < len(names):
        raise InputError(f"{path}: two balls share a name ({', '.join(names)})")


def _check_strokes(path: Path, file: HeadFile) -> None:
    """Refuse a head whose indicators reach further than they move or touch further out than their tips are wide."""
    largest = min(file.range_mm / 2, file.tip_mm / 2)
    if file.usable_mm > largest:
        raise InputError(
            f"{path}: 'gauge.head.usable_mm' = {file.usable_mm:g} is more than indicators of range_mm = "
            f"{file.range_mm:g} with tips of tip_mm = {file.tip_mm:g} allow: at most {largest:g}, half of either"
        )


def _check_master(path: Path, head: HeadFile, ball_mm: float) -> None:
    """Refuse a master ball that the indicators cannot show in their range beside balls of the diameter ``ball_mm``."""
    if not 0.0 <= head.master_mm - ball_mm <= 2 * head.range_mm:
        raise InputError(
            f"{path}: 'gauge.head.master_mm' = {head.master_mm:g} is the diameter of the master ball: with balls of "
            f"{ball_mm:g} mm and indicators of range_mm = {head.range_mm:g} it lies between {ball_mm:g} and "
            f"{ball_mm + 2 * head.range_mm:g}"
        )


def head_of(path: Path, file: HeadFile, map_axis: tuple[float, float, float]) -> Head:
    """Return the head with unit axes.

    Raises:
        InputError: the axes are not square, or the tool's axis does not lead out between the indicators.
    """
    axes = np.array(file.indicators)
    size = np.linalg.norm(axes, axis=1)
    if size.min() < 1e-9:
        raise InputError(f"{path}: 'gauge.head.indicators' has {file.indicators}, where one is no direction")
    axes = axes / size[:, None]
    for a, b in ((0, 1), (0, 2), (1, 2)):
        angle = float(np.rad2deg(np.arccos(np.clip(axes[a] @ axes[b], -1, 1))))
        if abs(angle - 90.0) > SQUARE:
            raise InputError(
                f"{path}: indicators {a + 1} and {b + 1} of 'gauge.head.indicators' stand at {angle:.1f}° to each "
                f"other: their axes must meet at right angles, to {SQUARE:g}°"
            )
    if (axes @ np.array(map_axis)).max() >= 0.0:
        raise InputError(
            f"{path}: 'tool.map_axis' = {list(map_axis)} must lead out of the head, away from all three indicators: "
            "the ball comes in along it"
        )
    _check_strokes(path, file)
    return Head(
        frozen(axes),
        file.range_mm * MM,
        file.usable_mm * MM,
        file.tip_mm * MM,
        file.approach_mm * MM,
        file.master_mm * MM,
        file.uncalibrated_mm * MM,
        file.centre_s,
    )
