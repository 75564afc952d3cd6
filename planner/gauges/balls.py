"""What gauges share whose tool point sits in, or is centred on, one of several balls of an artifact."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import ClassVar

import numpy as np

from planner.cell.file import CellFile, PlacedFile
from planner.cell.gauge_types import CellStep, place_text
from planner.cell.placement import P, Placement
from planner.cell.site import Site
from planner.common.errors import InputError
from planner.common.units import Array, IntArray, read_only, to_mm
from planner.gauges.frame_gauge import FrameGauge
from planner.gauges.placement.frames import SocketPlacement, place_sockets
from planner.gauges.placement.solver import flange_poses, index_in_cell
from planner.kinematics.geometry import pose
from planner.runs.run import Readings, Run, Samples


def artifact_step(file: CellFile, title: str, seats: str) -> CellStep:
    """Return the step of the checklist that sets the artifact up; ``seats``: what it carries."""
    there, names = file.artifact, ", ".join(b.name for b in file.balls)
    where = ""
    if there:
        origin = next((f", {b.name}," for b in file.balls if not any(b.position_mm)), "")
        place = f"{place_text(there.position_mm)} of the base frame, to about {there.prior_mm:g} mm"
        where = f" with the origin of its frame{origin} at {place}"
    still = "nothing moves it until the log is saved"
    return CellStep(title, f"It is clamped{where}: {still}. Wipe the {seats} {names} clean.")


@dataclass(frozen=True)
class BallGauge(FrameGauge):
    """Reads in which ball the tool point sits, and may read how far off its centre."""

    columns: ClassVar[str] = "ball"
    needs_range: ClassVar[bool] = False
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

    def leg_speeds(self, cell: Site, visit: np.ndarray) -> float | Array:
        """The last way to a ball, and the first away from it, are driven slowly: the indicators touch there."""
        at_ball = visit >= 0
        return np.where(at_ball[:-1] | at_ball[1:], cell.motion.tool_speed, np.inf)

    def positions(self, setup: Placement, readings: Readings) -> Array:
        """Return the ball's centre and what the gauge shows beside it, in the artifact's frame, (n, 3) [m]."""
        assert readings.ball is not None
        return np.asarray(setup.p_GS[readings.ball] + (0.0 if readings.offset is None else readings.offset))

    def number_places(self, setup: P, cell: Site, run: Run) -> P:
        """Return the setup with plates and balls as the run numbers them; a single plate needs no name."""
        names = run.places if len(run.places) > 1 else ("",)
        setup = super().number_places(setup, cell, replace(run, places=names))
        balls = tuple(b.name for b in cell.balls)
        order = [index_in_cell(run, name, balls, "ball", cell) for name in run.balls]
        return replace(setup, p_GS=setup.p_GS[order], ball_names=run.balls)

    def place(self, setup: P, run: Run, p_FM: Array | None) -> P:
        """Find the plates, and the tool points where the cell has none."""
        stand, r = flange_poses(setup, run, p_FM), run.readings
        assert r.ball is not None

        def place(ball: IntArray) -> tuple[SocketPlacement, float]:
            """Return the artifact placed by the balls that were read, and the rms distance that is left [m]."""
            found = place_sockets(stand, ball, setup.p_GS, r.offset, p_FM)
            in_plate = setup.p_GS[ball] + (0.0 if r.offset is None else r.offset)
            plate_point = np.einsum("nij,nj->ni", found.R_BP[stand.place], in_plate) + found.p_BP[stand.place]
            tool_point = np.einsum("nij,nj->ni", stand.R_BF, found.p_FM[stand.point]) + stand.p_BF
            return found, float(np.sqrt(((plate_point - tool_point) ** 2).sum(axis=1).mean()))

        plate, off = place(r.ball)
        check_exchanged_balls(run, setup.ball_names, off, lambda ball: place(ball)[1])
        return replace(setup, R_BG=plate.R_BP, p_BG=plate.p_BP, p_FM=plate.p_FM)

    def needs_new_frames(self, setup: Placement, run: Run) -> bool:
        """Another run may have been measured on a plate that was set down anew."""
        return True

    def check_run(self, cell: Site, run: Run) -> None:
        """Refuse a run without balls in the cell."""
        super().check_run(cell, run)
        if not cell.balls:
            raise InputError(
                f"{cell.path}: a gauge '{self.kind}' needs [[balls]] with their positions in the plate's frame"
            )

    def simulate(
        self, cell: Site, samples: Samples, predict: Callable[[Samples], Array],
        slopes: Callable[[Samples], Array], noise: Array,
    ) -> tuple[Samples, Readings]:  # fmt: skip
        """Centre the tool point on the ball nearest to each planned pose, millimetres away (Newton)."""
        ball = np.argmin(np.linalg.norm(cell.map_position(samples.q)[:, None] - cell.p_BS[None], axis=2), axis=1)
        goal = cell.p_BS[ball] + noise
        for _ in range(8):  # Newton steps
            missing = goal - predict(samples)
            step = np.einsum("nij,nj->ni", np.linalg.pinv(slopes(samples)), missing)
            samples = replace(samples, q=samples.q + step)
        return replace(samples, q=read_only(samples.q)), Readings(ball=ball)


def check_exchanged_balls(run: Run, names: tuple[str, ...], off: float, off_with: Callable[[IntArray], float]) -> None:
    """Refuse a run that fits much better with the names of two balls exchanged; ``off`` is how it fits now [m].

    Raises:
        InputError: naming the two.
    """
    ball, pairs = np.asarray(run.readings.ball), list(combinations(range(len(names)), 2))
    # 0.01: [rad] repeats of a pose are nearer. 4: poses; fewer fit nearly any balls, as the plate may stand anywhere
    if not pairs or len(np.unique(np.round(run.samples.q / 0.01), axis=0)) < 4 * max(len(run.places), 1):
        return
    swapped = [off_with(np.where(ball == a, b, np.where(ball == b, a, ball))) for a, b in pairs]
    best = int(np.argmin(swapped))
    a, b = pairs[best]
    # 0.7: of what the poses are off, with two names exchanged: errors of a robot do not do that
    if swapped[best] < 0.7 * off:
        raise InputError(
            f"{run.name}: balls {names[a]} and {names[b]} look exchanged: with their names as they are the poses are "
            f"{to_mm(off):.3g} mm off (rms), the other way round {to_mm(swapped[best]):.3g} mm. Correct the column "
            "'ball' of the run, or the places in [[balls]]"
        )


def nearest_ball(cell: Site, q: Array) -> int:
    """Return the ball that the measured point is nearest to at q (N,) [rad]."""
    return int(np.argmin(np.linalg.norm(cell.p_BS - cell.map_position(q[None]), axis=1)))


def check_names(path: Path, file: CellFile) -> None:
    """Refuse two balls of one name."""
    names = [b.name for b in file.balls]
    if len(set(names)) < len(names):
        raise InputError(f"{path}: two balls share a name ({', '.join(names)})")


def artifact_frame(cell: Site) -> Array:
    """Return how the artifact stands in the base frame, (4, 4) [m]."""
    return pose(cell.fixtures[0].R_BX, cell.fixtures[0].p_BX)
