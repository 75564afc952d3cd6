"""What gauges share whose tool point sits in, or is centred on, one of several balls of an artifact."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import ClassVar

import numpy as np

from planner.cell.cell import Ball, Cell
from planner.cell.file import CellFile, PlacedFile
from planner.cell.gauge_types import CellStep, GaugeBody, place_text
from planner.cell.setup import MeasurementSetup
from planner.common.errors import InputError
from planner.common.units import MM, UM, Array, read_only, to_mm
from planner.gauges.frame_gauge import FrameGauge
from planner.gauges.placement.flange_poses import flange_poses, index_in_cell
from planner.gauges.placement.sockets import SocketPlacement, place_sockets
from planner.kinematics.bodies import Body, capsule_between
from planner.kinematics.geometry import pose
from planner.runs.run import NO_REFERENCE_READINGS, IntArray, Mounting, Readings, ReferenceReadings, Run, Samples

INDICATOR_NOISE = 0.5 * UM  # scatter of an indicator on the master ball
NEWTON_STEPS = 8
MUCH_BETTER = 0.7  # of what the poses are off, with two names exchanged: errors of a robot do not do that
SHAFT_LENGTH = 30e-3  # [m] from the MAP to where the channel holds the indicator's shaft: a tip ends there


def artifact_step(file: CellFile, title: str, seats: str) -> CellStep:
    """Return the step that sets the artifact up; ``seats``: what it carries."""
    there, names = file.artifact, ", ".join(b.name for b in file.balls)
    where = f" at {place_text(there.position_mm)} of the base frame, to about {there.prior_mm:g} mm," if there else ""
    return CellStep(
        title,
        f"It stands{where} and is clamped: nothing moves it until the log is saved. Wipe the {seats} {names} clean.",
    )


@dataclass(frozen=True)
class BallGauge(FrameGauge):
    """Reads in which ball the tool point sits, and may read how far off its centre."""

    columns: ClassVar[str] = "ball"
    needs_range: ClassVar[bool] = False
    is_surveyed: ClassVar[bool] = True
    at_balls: ClassVar[bool] = True

    def declared_frame(self, file: CellFile) -> PlacedFile | None:
        """Return the artifact."""
        return file.artifact

    @classmethod
    def placed_section(cls, path: Path, file: CellFile) -> PlacedFile:
        """Return where the artifact stands."""
        if file.artifact is None:
            raise InputError(
                f"{path}: the section [artifact] with position_mm is missing: where the balls' frame stands in the "
                "base's"
            )
        return file.artifact

    @property
    def reading_seconds(self) -> float:
        """Time of one centring [s]."""
        return 0.0 if self.head is None else self.head.seconds

    def mastered_reading(self, cell: Cell) -> float | None:
        """Half of what the master ball's diameter is larger than a ball's."""
        return None if self.head is None or not cell.balls else self.head.master / 2 - cell.balls[0].radius

    def preparation(self, cell: Cell, mounting: Mounting) -> tuple[str, str]:
        """The indicators are mastered on the master ball."""
        master, shown = float(to_mm(self.indicators.master)), float(to_mm(self.mastered_reading(cell) or 0.0))
        return (
            f"master the indicators: lay the {master:g} mm ball into its socket",
            f"set all three indicators to {shown:.3f} mm, then take the ball out",
        )

    def ball_to_centre(self, cell: Cell, q: Array) -> int | None:
        """Return the ball that the measured point is nearest to."""
        if self.head is None:
            return None
        return int(np.argmin(np.linalg.norm(cell.p_BS - cell.map_position(q[None]), axis=1)))

    def leg_speeds(self, cell: Cell, visit: np.ndarray) -> float | Array:
        """The last way to a ball, and the first away from it, are driven slowly: the indicators touch there."""
        at_ball = visit >= 0
        return np.where(at_ball[:-1] | at_ball[1:], cell.motion.tool_speed, np.inf)

    def describe(self, cell: Cell) -> str:
        """Name the balls."""
        return f"head of three indicators on the balls {', '.join(b.name for b in cell.balls)}"

    def positions(self, setup: MeasurementSetup, readings: Readings) -> Array:
        """Return the ball's centre and what the gauge shows beside it, in the artifact's frame, (n, 3) [m]."""
        assert readings.ball is not None
        return np.asarray(setup.p_GS[readings.ball] + (0.0 if readings.offset is None else readings.offset))

    def number_places(self, setup: MeasurementSetup, cell: Cell, run: Run) -> MeasurementSetup:
        """Return the setup with plates and balls as the run numbers them; a single plate needs no name."""
        names = run.places if len(run.places) > 1 else ("",)
        setup = super().number_places(setup, cell, replace(run, places=names))
        balls = tuple(b.name for b in cell.balls)
        order = [index_in_cell(run, name, balls, "ball", cell) for name in run.balls]
        return replace(setup, p_GS=setup.p_GS[order], ball_names=run.balls)

    def place(self, setup: MeasurementSetup, run: Run, p_FM: Array | None) -> MeasurementSetup:
        """Find the plates, and the tool points where the cell has none."""
        stand, r = flange_poses(setup, run, p_FM), run.readings
        assert r.ball is not None

        def place(ball: IntArray) -> tuple[SocketPlacement, float]:
            found = place_sockets(stand, ball, setup.p_GS, r.offset, p_FM)
            in_plate = setup.p_GS[ball] + (0.0 if r.offset is None else r.offset)
            plate_point = np.einsum("nij,nj->ni", found.R_BP[stand.place], in_plate) + found.p_BP[stand.place]
            tool_point = np.einsum("nij,nj->ni", stand.R_BF, found.p_FM[stand.point]) + stand.p_BF
            return found, float(np.sqrt(((plate_point - tool_point) ** 2).sum(axis=1).mean()))

        plate, off = place(r.ball)
        _check_exchanged(run, setup.ball_names, off, lambda ball: place(ball)[1])
        return replace(setup, R_BG=plate.R_BP, p_BG=plate.p_BP, p_FM=plate.p_FM)

    def needs_new_frames(self, setup: MeasurementSetup, run: Run) -> bool:
        """Another run may have been measured on a plate that was set down anew."""
        return True

    def check_run(self, cell: Cell, run: Run) -> None:
        """Refuse a run without balls in the cell, or distances from a ball's centre in another unit than is said."""
        super().check_run(cell, run)
        if not cell.balls:
            raise InputError(
                f"{cell.path}: a gauge '{self.kind}' needs [[balls]] with their positions in the plate's frame"
            )
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

    def simulate(
        self, cell: Cell, samples: Samples, predict: Callable[[Samples], Array],
        slopes: Callable[[Samples], Array], noise: Array,
    ) -> tuple[Samples, Readings]:  # fmt: skip
        """Centre the tool point on the ball nearest to each planned pose, millimetres away (Newton)."""
        ball = np.argmin(np.linalg.norm(cell.map_position(samples.q)[:, None] - cell.p_BS[None], axis=2), axis=1)
        goal = cell.p_BS[ball] + noise
        for _ in range(NEWTON_STEPS):
            missing = goal - predict(samples)
            step = np.einsum("nij,nj->ni", np.linalg.pinv(slopes(samples)), missing)
            samples = replace(samples, q=samples.q + step)
        return replace(samples, q=read_only(samples.q)), Readings(ball=ball)

    def reference_readings(self, cell: Cell, rng: np.random.Generator) -> ReferenceReadings:
        """Return the indicators at the master ball, before and after."""
        wanted = self.mastered_reading(cell)
        if wanted is None:
            return NO_REFERENCE_READINGS
        masters = tuple(read_only(wanted + INDICATOR_NOISE * rng.standard_normal(3)) for _ in range(2))
        return ReferenceReadings(masters=masters)

    def centring_warnings(self, cell: Cell, planned: Samples, run: Run) -> tuple[str, ...]:
        """Count the balls that were met too far off centre; ``planned`` is where the arm was sent."""
        if self.head is None:
            return ()
        apart = np.linalg.norm(cell.map_position(run.samples.q) - cell.map_position(planned.q), axis=1)
        far = int((apart > self.head.usable).sum())
        if not far:
            return ()
        return (
            f"{far} of {len(run)} balls were met more than {self.head.usable / MM:g} mm off centre (largest "
            f"{apart.max() / MM:.1f}), where the head does not measure: this robot is further off than "
            f"gauge.head.uncalibrated_mm = {self.head.uncalibrated / MM:g} says; give smaller errors with --truth",
        )

    def bodies(self, cell: Cell) -> list[GaugeBody]:
        """The indicators' tips on the flange, and the artifact with balls and stems as the cell says that it stands."""
        if self.head is None:
            return []
        return [*self._tips(cell), *_artifact(cell)]

    def _tips(self, cell: Cell) -> Iterator[GaugeBody]:
        """Tips where they stand when a ball is centred (TriCal paper, 2.1).

        The round end of the capsule stands out of the flat disk by as much as its rim is cut off.
        """
        radius, touch = self.indicators.tip / 2, min(b.radius for b in cell.balls)
        for k, axis in enumerate(self.indicators.axes_F):
            a, b = (cell.tool.p_FM + axis * s for s in (touch + radius / 2, SHAFT_LENGTH))
            yield GaugeBody(capsule_between(f"tip of indicator {k + 1}", a, b, radius), "flange", tip=True)


def _check_exchanged(run: Run, names: tuple[str, ...], off: float, off_with: Callable[[IntArray], float]) -> None:
    """Refuse a run that fits much better with the names of two balls exchanged; ``off`` is how it fits now [m].

    Raises:
        InputError: naming the two.
    """
    ball, pairs = np.asarray(run.readings.ball), list(combinations(range(len(names)), 2))
    if not pairs:
        return
    swapped = [off_with(np.where(ball == a, b, np.where(ball == b, a, ball))) for a, b in pairs]
    best = int(np.argmin(swapped))
    a, b = pairs[best]
    if swapped[best] < MUCH_BETTER * off:
        raise InputError(
            f"{run.name}: balls {names[a]} and {names[b]} look exchanged: with their names as they are the poses are "
            f"{to_mm(off):.3g} mm off (rms), the other way round {to_mm(swapped[best]):.3g} mm; correct the column "
            "'ball' of the run, or the places in [[balls]]"
        )


def check_names(path: Path, file: CellFile) -> None:
    """Refuse two balls of one name."""
    names = [b.name for b in file.balls]
    if len(set(names)) < len(names):
        raise InputError(f"{path}: two balls share a name ({', '.join(names)})")


def artifact_frame(cell: Cell) -> Array:
    """Return how the artifact stands in the base frame, (4, 4) [m]."""
    return pose(cell.fixtures[0].R_BX, cell.fixtures[0].p_BX)


def _artifact(cell: Cell) -> list[GaugeBody]:
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
