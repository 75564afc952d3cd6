"""The TriCal head: three indicators that meet in the tool point are centred on the balls of an artifact."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from planner.cell.cell import Cell, IndicatorHead
from planner.cell.file import CellFile, IndicatorHeadFile, PlacedFile
from planner.cell.gauge_registry import register_gauge
from planner.cell.gauge_types import CellStep, SessionGuide, place_text
from planner.common.errors import InputError
from planner.common.units import MM, Array, read_only
from planner.gauges.balls import BallGauge, artifact_step, check_names
from planner.kinematics.inverse_kinematics import retract_tool
from planner.kinematics.robot import Robot

SQUARE = 1.0  # [deg] by which two indicators may miss a right angle


@register_gauge
@dataclass(frozen=True)
class TriCalHead(BallGauge):
    """A head of three indicators, read when the robot has centred it on a ball."""

    kind: ClassVar[str] = "trical"
    default_noise_um: ClassVar[float] = 3.0
    measured_by: ClassVar[str] = "edbb centre PLAN measures it"

    @classmethod
    def read_own(cls, path: Path, robot: Robot, file: CellFile, planning: bool) -> dict[str, Any]:
        """Return the head."""
        return {"head": read_head(path, file)}

    @classmethod
    def placed_section(cls, path: Path, file: CellFile) -> PlacedFile:
        """Return where the artifact stands, once artifact, balls and head are checked."""
        placed = super().placed_section(path, file)
        _check_trical(path, file)
        return placed

    @classmethod
    def session_guide(cls, file: CellFile) -> SessionGuide:
        """The indicators are mastered before and after; the robot is centred on each ball until all show that again."""
        head = file.gauge.head
        size = f"the {head.master_mm:g} mm ball" if head else "the master ball"
        shown = f"{head.master_mm / 2 - file.balls[0].radius_mm:.3f} mm" if head and file.balls else "zero"
        tool = f" Its tool point lies at {place_text(file.tool.map_mm)} of the flange." if file.tool else ""
        mastered = f"Where the program pauses, the head's opening upwards: lay {size} into its socket,"
        return SessionGuide(
            "the name of the ball (ball); edbb centre writes all of it by itself",
            (
                artifact_step(file, "Artifact and its balls", "balls"),
                CellStep("Head of indicators", f"All three move freely and are connected.{tool}"),
            ),
            (CellStep("Master the indicators", f"{mastered} set all three indicators to {shown}, take the ball out."),),
            "At each ball edbb centre drives the robot until all three indicators show what they showed at the master "
            "ball; without it, jog there by hand and note the joint angles. Keep the stop at hand.",
            (CellStep("Master again", "Lay the master ball in once more and note the indicators: have they drifted?"),),
        )

    def starts_among(self, q: Array) -> Array | None:
        """The indicators are mastered with the head's opening upwards."""
        return None

    def retract(self, cell: Cell, q: Array, ball: int) -> tuple[Array, Array]:
        """The head comes along its own axis, turned as at the ball."""
        return retract_tool(cell.chain, cell.robot, q, self.indicators.approach * cell.tool.axis_F)


def _check_trical(path: Path, file: CellFile) -> None:
    if not file.balls:
        raise InputError(f"{path}: a head of indicators needs at least one [[balls]] table")
    if file.gauge.head is None:
        raise InputError(
            f"{path}: the section [gauge.head] with indicators is missing: the directions of the three indicators from "
            "the tool point, in the flange frame"
        )
    _check_master(path, file.gauge.head, 2 * file.balls[0].radius_mm)
    check_names(path, file)


def _check_strokes(path: Path, file: IndicatorHeadFile) -> None:
    """Refuse a head whose indicators reach further than they move or touch further out than their tips are wide."""
    largest = min(file.range_mm / 2, file.tip_mm / 2)
    if file.usable_mm > largest:
        raise InputError(
            f"{path}: 'gauge.head.usable_mm' = {file.usable_mm:g} is more than indicators of range_mm = "
            f"{file.range_mm:g} with tips of tip_mm = {file.tip_mm:g} allow: at most {largest:g}, half of either"
        )


def _check_master(path: Path, head: IndicatorHeadFile, ball_mm: float) -> None:
    """Refuse a master ball that the indicators cannot show in their range beside balls of the diameter ``ball_mm``."""
    if not 0.0 <= head.master_mm - ball_mm <= 2 * head.range_mm:
        raise InputError(
            f"{path}: 'gauge.head.master_mm' = {head.master_mm:g} is the diameter of the master ball: with balls of "
            f"{ball_mm:g} mm and indicators of range_mm = {head.range_mm:g} it lies between {ball_mm:g} and "
            f"{ball_mm + 2 * head.range_mm:g}"
        )


def read_head(path: Path, cell: CellFile) -> IndicatorHead | None:
    """Return the head of indicators with unit axes, ``None`` where the cell file has none.

    Raises:
        InputError: the axes are not square, or the tool's axis does not lead out between the indicators.
    """
    file = cell.gauge.head
    if file is None:
        return None
    map_axis = (0.0, 0.0, 1.0) if cell.tool is None else cell.tool.map_axis
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
    return IndicatorHead(
        read_only(axes),
        file.range_mm * MM,
        file.usable_mm * MM,
        file.tip_mm * MM,
        file.approach_mm * MM,
        file.master_mm * MM,
        file.uncalibrated_mm * MM,
        file.centre_s,
    )
