"""A ball on the tool that a person leads into one of several sockets of a plate; its pose shows where the arm stands.

The program brings the ball to a short way above the socket and waits there: an arm that is not calibrated would miss
the seat by millimetres. It drives on from the seat, along the path that was proven.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pydantic import BaseModel, PositiveFloat

from planner.cell.file import CellFile, PlacedFile
from planner.cell.gauge_registry import register_gauge
from planner.cell.gauge_types import CellStep, GaugeBody, PlannedVisit, SessionGuide, place_text
from planner.cell.site import Site
from planner.common.choices import ReadBy
from planner.common.errors import InputError
from planner.common.schema import StrictModel, validate
from planner.common.units import MM, Array, read_only, to_deg
from planner.gauges.balls import BallGauge, artifact_frame, artifact_step, check_names, nearest_ball
from planner.kinematics.bodies import Body
from planner.kinematics.geometry import pose
from planner.kinematics.inverse_kinematics import shift_point
from planner.kinematics.robot import Robot
from planner.runs.run import Mounting


class SocketKeys(StrictModel):
    """Own keys of ``[gauge]``: from where a socket is come to, and how far above it the program waits."""

    approach_mm: PositiveFloat = 40.0
    wait_mm: PositiveFloat = 15.0


@register_gauge
@dataclass(frozen=True)
class BallSocket(BallGauge):
    """Sockets at known places in a plate's own frame, each with its way out.

    Attributes:
        approach: how far out of the seat the ball is come from, and leaves to [m].
    """

    approach: float = 40 * MM

    kind: ClassVar[str] = "ball-socket"
    ways_to_read: ClassVar[tuple[ReadBy, ...]] = ("hand",)
    # [s] a person leads the ball in, notes the joints and presses a key
    usual_reading_times: ClassVar[Mapping[ReadBy, float]] = {"hand": 30.0}
    largest_scale: ClassVar[float] = 5e-3  # a printed plate shrinks by half a percent at most
    default_noise_um: ClassVar[float] = 100.0
    pose_columns: ClassVar[tuple[str, str]] = ("socket", "tilt in it (°)")
    OwnKeys: ClassVar[type[BaseModel] | None] = SocketKeys
    usual_keys: ClassVar[Mapping[str, Mapping[str, object]]] = {
        "plan": {"index": "O1", "poses": 60, "refine": False, "candidates": 24_000}
    }

    @classmethod
    def read_own(cls, path: Path, robot: Robot, file: CellFile, planning: bool) -> dict[str, Any]:
        """Return the approach, and the share of it that is left to a person.

        Raises:
            InputError: the program would wait further out than it comes from.
        """
        keys = validate(file.gauge.own, SocketKeys, f"{path}: [gauge]")
        if keys.wait_mm >= keys.approach_mm:
            raise InputError(
                f"{path}: 'gauge.wait_mm' = {keys.wait_mm:g}, where the program waits above a socket, must be less "
                f"than gauge.approach_mm = {keys.approach_mm:g}, from where it comes"
            )
        return {"approach": keys.approach_mm * MM, "left_to_person": keys.wait_mm / keys.approach_mm}

    @classmethod
    def placed_section(cls, path: Path, file: CellFile) -> PlacedFile:
        """Return where the plate stands, once its sockets are checked."""
        if not file.balls:
            raise InputError(f"{path}: a plate needs at least one socket, a [[balls]] table with name and position_mm")
        check_names(path, file)
        return super().placed_section(path, file)

    @classmethod
    def session_guide(cls, file: CellFile) -> SessionGuide:
        """The ball on the tool is led into a socket at every pose."""
        size = f"the {2 * file.balls[0].radius_mm:g} mm ball" if file.balls else "the ball"
        tool = f" with its centre at {place_text(file.tool.map_mm)} of the flange" if file.tool else ""
        return SessionGuide(
            "the name of the socket (ball)",
            (artifact_step(file, "Plate and its sockets", "sockets"),),
            (CellStep("Fit the ball", f"Where the program pauses: fit {size} to the tool{tool}, wipe it clean."),),
        )

    @classmethod
    def reading_text(cls, file: CellFile) -> str:
        """A person seats the ball at every pose."""
        keys = validate(file.gauge.own, SocketKeys, "[gauge]")
        seconds = file.gauge.reading_s or cls.usual_reading_times["hand"]
        return (
            f"At each pose the program stops {keys.wait_mm:g} mm above a socket and names the pose: lead the ball in "
            "by hand or by jogging until it rests, note the joints, then let the program go on. The planned time "
            f"counts {seconds:g} s for each pose."
        )

    @property
    def ends(self) -> tuple[str, str]:
        """A socket of the plate, and the ball that is led into it."""
        return "socket", "ball"

    @property
    def drives_on_when_read(self) -> bool:
        """The robot dwells once the ball is seated: its axes are logged then."""
        return False

    def preparation(self, cell: Site, mounting: Mounting) -> tuple[str, str]:
        """The ball is fitted to the tool."""
        size = 2e3 * cell.balls[0].radius
        return "", f"fit the {size:g} mm ball to the tool, wipe ball and sockets clean"

    def seating_step(self, cell: Site, q: Array) -> str:
        """The ball is led into the socket by hand, or by jogging."""
        socket = cell.balls[nearest_ball(cell, q)].name
        return f"lead the ball into socket {socket} and note the joints"

    def retract(self, cell: Site, q: Array, ball: int) -> tuple[Array, Array]:
        """The ball leaves along the socket's axis; the tool may turn about it."""
        return shift_point(cell.chain, cell.robot, q, self.approach * _way_out(cell, ball))

    def fits(self, cell: Site, q: Array, ball: int) -> np.ndarray:
        """The tool's axis leads into the socket, within the cone."""
        return np.asarray(self._tilt(cell, q, ball) < min(self.cone_fixture, self.cone_map))

    def _tilt(self, cell: Site, q: Array, ball: int) -> Array:
        return np.asarray(np.arccos(np.clip(-cell.map_axis(q) @ _way_out(cell, ball), -1.0, 1.0)))

    def describe(self, cell: Site) -> str:
        """Name the sockets."""
        return f"ball on the tool in the sockets {', '.join(b.name for b in cell.balls)}"

    def visit_cells(self, cell: Site, visit: PlannedVisit) -> tuple[str, str]:
        """Return the socket, and how far the tool is tilted in it."""
        if visit.ball < 0:
            return "", ""
        tilt = float(to_deg(self._tilt(cell, visit.q[None], visit.ball)[0]))
        return cell.balls[visit.ball].name, f"{tilt:.0f}"

    def plan_error_text(self, pose: int, error: float) -> str:
        """Say how far the tool's ball is from its socket at a pose."""
        return f"pose {pose} is {error:.3f} mm off its socket"

    def bodies(self, cell: Site) -> list[GaugeBody]:
        """The ball on the tool, which may touch the socket that it is led into; the plate, and its sockets."""
        T, place = artifact_frame(cell), pose(np.eye(3), cell.tool.p_FM)
        size = (min(b.radius for b in cell.balls),)
        ball = GaugeBody(Body("ball on the tool", "sphere", size, read_only(place)), "flange", tip=True)
        plate = [GaugeBody(replace(b, T=read_only(T @ b.T)), "world") for b in cell.carrier]
        return [ball, *plate, *(_socket(cell, k, T) for k in range(len(cell.balls)))]


def _way_out(cell: Site, ball: int) -> Array:
    return np.asarray(cell.fixtures[0].R_BX @ cell.balls[ball].axis_G)


def _socket(cell: Site, k: int, T: Array) -> GaugeBody:
    """A sphere of the ball's size below it: its top is where the ball's centre comes to rest."""
    ball = cell.balls[k]
    place = pose(np.eye(3), ball.p_GS - ball.radius * ball.axis_G)
    return GaugeBody(Body(f"socket {ball.name}", "sphere", (ball.radius,), read_only(T @ place)), "world", ball=k)
