"""The TriCal head: three indicators that meet in the tool point are centred on the balls of an artifact."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from planner.cell.file import CellFile, IndicatorHeadFile, PlacedFile
from planner.cell.gauge_registry import register_gauge
from planner.cell.gauge_types import CellStep, GaugeBody, SessionGuide, place_text
from planner.cell.parts import Ball, IndicatorHead
from planner.cell.site import Site
from planner.common.advice import Occasion, advice
from planner.common.choices import ReadBy
from planner.common.errors import InputError
from planner.common.units import MM, UM, Array, read_only, to_mm
from planner.gauges.balls import BallGauge, artifact_frame, artifact_step, check_names, nearest_ball
from planner.kinematics.bodies import Body, capsule_between
from planner.kinematics.geometry import pose
from planner.kinematics.inverse_kinematics import retract_tool
from planner.kinematics.robot import Robot
from planner.runs.run import NO_REFERENCE_READINGS, Mounting, ReferenceReadings, Run, Samples

BY_HAND = (
    "At each ball jog the robot by hand until all three indicators show what they showed at the master ball, and note "
    "the joint angles."
)


@register_gauge
@dataclass(frozen=True)
class TriCalHead(BallGauge):
    """A head of three indicators, read when the robot has centred it on a ball."""

    kind: ClassVar[str] = "trical"
    default_noise_um: ClassVar[float] = 3.0
    ways_to_read: ClassVar[tuple[ReadBy, ...]] = ("centring",)

    @property
    def ends(self) -> tuple[str, str]:
        """A ball of the artifact, and the head that is centred on it."""
        return "ball", "head"

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
            f"the name of the ball (ball){advice(Occasion.CENTRED_COLUMNS)}",
            (
                artifact_step(file, "Artifact and its balls", "balls"),
                CellStep("Head of indicators", f"All three move freely and are connected.{tool}"),
            ),
            (CellStep("Master the indicators", f"{mastered} set all three indicators to {shown}, take the ball out."),),
            "Keep the stop at hand.",
            (CellStep("Master again", "Lay the master ball in once more and note the indicators: have they drifted?"),),
        )

    @classmethod
    def reading_text(cls, file: CellFile) -> str:
        """The head is centred on the ball by the routine that the program calls, or by hand."""
        counted = f" The planned time counts {file.gauge.head.centre_s:g} s for each ball." if file.gauge.head else ""
        return f"{advice(Occasion.CENTRED_BALL, BY_HAND)}{counted}"

    @property
    def measuring_command(self) -> str:
        """How the session is measured: by the extension that centres the head on each ball, if there is one."""
        return advice(Occasion.CENTRED_SESSION, super().measuring_command)

    def start_states(self, q: Array) -> Array | None:
        """The indicators are mastered with the head's opening upwards."""
        return None

    def retract(self, cell: Site, q: Array, ball: int) -> tuple[Array, Array]:
        """The head comes along its own axis, turned as at the ball."""
        return retract_tool(cell.chain, cell.robot, q, self.indicators.approach * cell.tool.axis_F)

    @property
    def reading_seconds(self) -> float:
        """Time of one centring [s]."""
        return self.indicators.seconds

    def mastered_reading(self, cell: Site) -> float | None:
        """Half of what the master ball's diameter is larger than a ball's."""
        return None if self.head is None or not cell.balls else self.head.master / 2 - cell.balls[0].radius

    def preparation(self, cell: Site, mounting: Mounting) -> tuple[str, str]:
        """The indicators are mastered on the master ball."""
        master, shown = float(to_mm(self.indicators.master)), float(to_mm(self.mastered_reading(cell) or 0.0))
        return (
            f"master the indicators: lay the {master:g} mm ball into its socket",
            f"set all three indicators to {shown:.3f} mm, then take the ball out",
        )

    def ball_to_centre(self, cell: Site, q: Array) -> int | None:
        """Return the ball that the measured point is nearest to."""
        return nearest_ball(cell, q)

    def describe(self, cell: Site) -> str:
        """Name the balls."""
        return f"head of three indicators on the balls {', '.join(b.name for b in cell.balls)}"

    def check_run(self, cell: Site, run: Run) -> None:
        """Refuse distances from a ball's centre in another unit than is said."""
        super().check_run(cell, run)
        offset = run.readings.offset
        if offset is None or self.head is None:
            return
        far = np.flatnonzero(np.abs(offset).max(axis=1) > self.head.range)
        if len(far):
            found = np.abs(offset[far[0]]).max() / MM
            raise InputError(
                f"{run.where(int(far[0]))}: the ball is {found:.4g} mm off centre, but the indicators "
                f"(gauge.head.range_mm) move by {self.head.range / MM:g} mm in all: are dx_mm, dy_mm, dz_mm in "
                "millimetres?"
            )

    def reference_readings(self, cell: Site, rng: np.random.Generator) -> ReferenceReadings:
        """Return the indicators at the master ball, before and after."""
        wanted = self.mastered_reading(cell)
        if wanted is None:
            return NO_REFERENCE_READINGS
        # 0.5 * UM: scatter of an indicator on the master ball
        masters = tuple(read_only(wanted + (0.5 * UM) * rng.standard_normal(3)) for _ in range(2))
        return ReferenceReadings(masters=masters)

    def centring_warnings(self, cell: Site, planned: Samples, run: Run) -> tuple[str, ...]:
        """Count the balls that were met too far off centre; ``planned`` is where the arm was sent."""
        head = self.indicators
        apart = np.linalg.norm(cell.map_position(run.samples.q) - cell.map_position(planned.q), axis=1)
        far = int((apart > head.usable).sum())
        if not far:
            return ()
        return (
            f"{far} of {len(run)} balls were met more than {head.usable / MM:g} mm off centre (largest "
            f"{apart.max() / MM:.1f}), where the head does not measure: this robot is further off than "
            f"gauge.head.uncalibrated_mm = {head.uncalibrated / MM:g} says; give smaller errors with --truth",
        )

    def bodies(self, cell: Site) -> list[GaugeBody]:
        """The indicators' tips on the flange, and the artifact with balls and stems as the cell says that it stands."""
        return [] if self.head is None else [*self._tips(cell), *_artifact(cell)]

    def _tips(self, cell: Site) -> Iterator[GaugeBody]:
        """Tips where they stand when a ball is centred (TriCal paper, 2.1).

        The round end of the capsule stands out of the flat disk by as much as its rim is cut off.
        """
        radius, touch = self.indicators.tip / 2, min(b.radius for b in cell.balls)
        for k, axis in enumerate(self.indicators.axes_F):
            # 30e-3: [m] from the MAP to where the channel holds the indicator's shaft: a tip ends there
            a, b = (cell.tool.p_FM + axis * s for s in (touch + radius / 2, 30e-3))
            yield GaugeBody(capsule_between(f"tip of indicator {k + 1}", a, b, radius), "flange", tip=True)


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
    square = 1.0  # [deg] by which two indicators may miss a right angle
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
        if abs(angle - 90.0) > square:
            raise InputError(
                f"{path}: indicators {a + 1} and {b + 1} of 'gauge.head.indicators' stand at {angle:.1f}° to each "
                f"other: their axes must meet at right angles, to {square:g}°"
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


def _artifact(cell: Site) -> list[GaugeBody]:
    T = artifact_frame(cell)
    carrier = [replace(b, T=read_only(T @ b.T)) for b in cell.carrier]
    stems = [s for b in cell.balls if (s := _stem(b, T)) is not None]
    return [
        *(GaugeBody(b, "world") for b in (*carrier, *stems)),
        *(GaugeBody(_ball(b, T), "world", ball=k) for k, b in enumerate(cell.balls)),
    ]


def _ball(ball: Ball, T: Array) -> Body:
    place = pose(np.eye(3), ball.p_GS)
    return Body(f"ball {ball.name}", "sphere", (ball.radius,), read_only(T @ place))


def _stem(ball: Ball, T: Array) -> Body | None:
    """A capsule that begins inside the ball, so that its round end does not stand out of it."""
    if ball.stem is None:
        return None
    way = ball.stem - ball.p_GS
    length = float(np.linalg.norm(way))
    start = min(ball.radius - ball.stem_radius, length)
    name = f"stem of ball {ball.name}"
    body = capsule_between(name, ball.p_GS + way / length * max(start, 0.0), ball.stem, ball.stem_radius)
    return replace(body, T=read_only(T @ body.T))
