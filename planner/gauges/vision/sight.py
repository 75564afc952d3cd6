"""Where a camera sees a board whole and sharp, how both stand in a cell, and what a person does with them.

What a cell file says of a camera and its board: ``[gauge.lens]``, ``[gauge.board]``, ``[gauge.place]``.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BaseModel, Field, PositiveFloat, PositiveInt

from planner.cell.file import CellFile, PlacedFile
from planner.cell.gauge_types import (
    CellStep,
    FilterStage,
    GaugeBody,
    JointSamples,
    PointTravel,
    SessionGuide,
    place_text,
)
from planner.cell.parts import Fixture
from planner.cell.places import placed_frame
from planner.cell.site import Site
from planner.common.errors import InputError
from planner.common.schema import StrictModel
from planner.common.sequences import sobol_points
from planner.common.units import MM, Array, read_only
from planner.gauges.frame_gauge import FrameGauge
from planner.gauges.vision.board import Board, BoardFile
from planner.gauges.vision.lens import Lens
from planner.kinematics.bodies import capsule_between
from planner.kinematics.geometry import bar_state, exp3, tilt_angle
from planner.kinematics.inverse_kinematics import solve_pose_ik
from planner.kinematics.robot import Robot
from planner.runs.run import Mounting


class LensFile(StrictModel):
    """``[gauge.lens]``: the camera's intrinsics as OpenCV has them."""

    fx_px: PositiveFloat
    fy_px: PositiveFloat
    cx_px: float
    cy_px: float
    distortion: tuple[float, ...] = Field(default=(), max_length=5)  # k1, k2, p1, p2, k3
    width_px: PositiveInt
    height_px: PositiveInt
    free: bool = False  # whether a run finds them; the file then says where to begin

    @property
    def lens(self) -> Lens:
        """Return the lens of these keys."""
        bent = np.array([*self.distortion, *[0.0] * 5][:5])
        return Lens(
            read_only([self.fx_px, self.fy_px]),
            read_only([self.cx_px, self.cy_px]),
            read_only(bent),
            (self.width_px, self.height_px),
        )


class CameraKeys(StrictModel):
    """The keys of ``[gauge]`` that only a camera has."""

    camera: Literal["flange", "stand"]
    board: BoardFile
    lens: LensFile
    noise_px: PositiveFloat = 0.3
    place: PlacedFile | None = None
    tool_rpy_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class BoardSight(FrameGauge):
    """A camera and a board.

    Attributes:
        lens, board: what sees and what is seen.
        on_flange: whether the camera is on the flange and the board stands; else the board is on the flange.
        noise_px: standard deviation of u and of v of a corner [px].
        lens_free: whether a run finds the lens as well.
        R_BG, p_BG: the frame of what stands, in the base frame or in that of the placement, (3, 3) and (3,) [m].
        R_FM: how what is on the flange is turned there, (3, 3), or in the placement's.
    """

    lens: Lens = None  # type: ignore[assignment]
    board: Board = None  # type: ignore[assignment]
    on_flange: bool = True
    noise_px: float = 0.3
    lens_free: bool = False
    R_BG: Array = field(default_factory=lambda: read_only(np.eye(3)))
    p_BG: Array = field(default_factory=lambda: read_only(np.zeros(3)))
    R_FM: Array = field(default_factory=lambda: read_only(np.eye(3)))

    noun: ClassVar[str] = "camera"
    usual_keys: ClassVar[Mapping[str, Mapping[str, object]]] = {
        "cone_deg": {"fixture": 50.0, "map": 50.0}, "body": {"trim_mm": 60.0}, "plan": {"candidates": 12_000},
    }  # fmt: skip
    pose_columns: ClassVar[tuple[str, str]] = ("board", "distance (mm)")
    OwnKeys: ClassVar[type[BaseModel] | None] = CameraKeys

    # ---- as a cell file says it

    @classmethod
    def read(cls, path: Path, robot: Robot, file: CellFile, planning: bool) -> Self:
        """Return the gauge of a cell file, its noise in lengths at the board."""
        g = file.gauge
        if g.noise_um is not None or cls.noise_of_angles(g) is not None:
            key = "noise_mdeg" if g.noise_um is None else "noise_um"
            raise InputError(f"{path}: 'gauge.{key}': the noise of a camera is that of a corner, 'gauge.noise_px'")
        if g.scale_ppm is not None:
            raise InputError(f"{path}: 'gauge.scale_ppm': a camera's scale is its board's, 'gauge.board.scale_ppm'")
        made = super().read(path, robot, file, planning)
        if made.length_min <= made.board.radius and planning:
            raise InputError(
                f"{path}: 'gauge.length_mm' begins at {made.length_min / MM:g} mm, nearer than the board is large "
                f"({made.board.radius / MM:.0f} mm from its middle to its furthest corner): no picture shows it whole"
            )
        return replace(made, noise=float(made.sigmas[0]))

    @property
    def fields_by_name(self) -> dict[str, Any]:
        """All that it was made of, for another kind of camera."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @classmethod
    def read_own(cls, path: Path, robot: Robot, file: CellFile, planning: bool) -> dict[str, Any]:
        """Return lens, board, and how they stand."""
        own = super().read_own(path, robot, file, planning)
        placed, (roll, pitch, yaw) = own["place"], own["tool_rpy_deg"]
        R_FM = placed_frame(PlacedFile(position_mm=(0, 0, 0), rpy_deg=(roll, pitch, yaw)))[0]
        R_BG, p_BG = (np.eye(3), np.zeros(3)) if placed is None else placed_frame(placed)
        tool = file.tool
        if tool is not None:
            axis = np.array(tool.map_axis) / np.linalg.norm(tool.map_axis)
            if np.linalg.norm(axis - R_FM[:, 2]) > 1e-3:
                z = [round(float(v), 6) + 0.0 for v in R_FM[:, 2]]
                raise InputError(
                    f"{path}: 'tool.map_axis' = {list(tool.map_axis)}, but 'gauge.tool_rpy_deg' = "
                    f"{[roll, pitch, yaw]} turns the z axis of what is on the flange to {z}: make them agree"
                )
        return {
            "lens": own["lens"].lens, "lens_free": own["lens"].free,
            "board": own["board"].board, "on_flange": own["camera"] == "flange",
            "noise_px": own["noise_px"], "R_BG": read_only(R_BG), "p_BG": read_only(p_BG), "R_FM": read_only(R_FM),
        }  # fmt: skip

    @classmethod
    def placed_section(cls, path: Path, file: CellFile) -> PlacedFile:
        """Return where the board or the camera stands."""
        place = file.gauge.own.get("place")
        if place is None:
            what = "board" if file.gauge.own.get("camera") == "flange" else "camera"
            raise InputError(f"{path}: the section [gauge.place] with position_mm is missing: where the {what} stands")
        return PlacedFile.model_validate(place)

    # ---- where it sees

    def joint_sampler(self, cell: Site, mounting: Mounting, seed: int) -> Callable[[int], JointSamples]:
        """Draw states in which one looks at the other: few of all states do.

        Distance, direction from the board, turns of the picture and the state to begin from are drawn, and inverse
        kinematics brings the arm there. An arm of fewer than six joints is drawn like that of a bar.
        """
        ik_steps = 25  # after which a state that has not come to its pose is dropped
        pose_axes = 6  # of a pose in space
        if cell.robot.n_joints < pose_axes:
            return super().joint_sampler(cell, mounting, seed)
        draw, place = sobol_points(pose_axes + cell.robot.n_joints, seed), cell.fixtures[mounting.fixture]
        lower, upper = cell.sampling_range

        def sample(count: int) -> JointSamples:
            """Draw ``count`` looks at the board and bring the arm there."""
            u = draw(count)
            p_BM, R_BM = self._looks(place, u[:, :pose_axes])
            start = lower + u[:, pose_axes:] * (upper - lower)
            q, there = solve_pose_ik(cell.chain, cell.robot, start, p_BM, R_BM @ self.R_FM.T, ik_steps)
            turn = np.where(cell.robot.slides, np.inf, 2 * np.pi)
            q = q + np.round((np.clip(q, lower, upper) - q) / turn) * np.where(cell.robot.slides, 0.0, turn)
            return JointSamples(q[there], count)

        return sample

    def _looks(self, place: Fixture, u: Array) -> tuple[Array, Array]:
        """Return where the tool point is and how its frame is turned, (n, 3) [m] and (n, 3, 3), for u (n, 6) in [0, 1].

        Directions are uniform on the sphere within the cones, the whole board within the picture as far as it is known.
        """
        near, far = self.planned_range
        distance = near + u[:, 0] * (far - near)
        wide = np.arcsin(np.clip(self.board.radius / distance, 0.0, 1.0))
        in_picture = np.maximum(self.lens.half_angle - wide, 0.0)
        at_place, at_tool = (self.cone_fixture, in_picture) if self.on_flange else (in_picture, self.cone_map)
        away = place.R_BX @ _in_cone(u[:, 1:3], at_place)[..., None]
        p_BM = place.p_BX + distance[:, None] * away[..., 0]
        back = frames_along(-away[..., 0])
        aside = _in_cone(u[:, 3:5], at_tool)
        R_BM = back @ frames_along(aside)
        roll = np.zeros((len(u), 3))
        roll[:, 2] = 2 * np.pi * u[:, 5]
        return p_BM, R_BM @ exp3(roll)

    @property
    def margin_columns(self) -> tuple[tuple[FilterStage, str], ...]:
        """Both ends of where the picture is sharp, the frame of the picture, the slant of the board."""
        return (
            ("workspace", "nearest sharp distance"),
            ("workspace", "farthest sharp distance"),
            ("cones", "whole board in the picture"),
            ("cones", "slant of the board"),
        )

    def margins(self, stage: FilterStage, place: Fixture, p_BM: Array, axis_B: Array) -> Array:
        """Distance within the range, the whole board within the picture, its slant within its own cone."""
        line = bar_state(p_BM, place.p_BX)
        if stage == "workspace":
            return super().margins(stage, place, p_BM, axis_B)
        if stage == "cones":
            tilts = tilt_angle(line.direction, place.axis_B), tilt_angle(-line.direction, axis_B)
            at_camera, at_board = tilts[::-1] if self.on_flange else tilts
            large = np.arcsin(np.clip(self.board.radius / np.maximum(line.length, 1e-9), 0.0, 1.0))
            slant = self.cone_fixture if self.on_flange else self.cone_map
            return np.column_stack([self.lens.half_angle - large - at_camera, slant - at_board])
        return np.empty((len(p_BM), 0))

    def margin_changes(self, travel: PointTravel) -> list[Array]:
        """Bound each margin's change: distances and size by the travel, tilts by swing and turn."""
        r, d = self.board.radius, self.length_min
        grows = travel.stretch * r / (d * np.sqrt(max(d * d - r * r, 1e-12)))
        turned, still = travel.swing + travel.turn, travel.swing
        at_camera, at_board = (turned, still) if self.on_flange else (still, turned)
        return [travel.stretch, travel.stretch, at_camera + grows, at_board]

    def bodies(self, cell: Site) -> list[GaugeBody]:
        """The line of sight, from both its ends as far as it reaches at its shortest: nothing may stand in it."""
        sight_radius = 5e-3  # [m] of the line of sight, which nothing may stand in
        start, end = self.trim + sight_radius, max(self.length_min - self.trim, self.trim + 3 * sight_radius)
        z = np.array([0.0, 0.0, 1.0])
        near = capsule_between("line of sight at the place", z * start, z * end, sight_radius)
        far = capsule_between("line of sight at the tool", -z * start, -z * end, sight_radius)
        return [GaugeBody(near, "housing"), GaugeBody(far, "rod")]

    @property
    def unchecked_length(self) -> float:
        """Length in the middle of the longest line of sight that no body stands for [m]."""
        return max(self.length_max - 2.0 * (self.length_min - self.trim), 0.0)

    # ---- words

    def preparation(self, cell: Site, mounting: Mounting) -> tuple[str, str]:
        """Return the instruction that nothing may change at the camera from here on."""
        return ("", "switch the light on, fix focus, exposure and gain, and look at one image: is the board sharp?")

    @classmethod
    def session_guide(cls, file: CellFile) -> SessionGuide:
        """Board and camera are fixed; at every pose one image is taken at rest."""
        own, tool = file.gauge.own, file.tool
        flange = own.get("camera") == "flange"
        moving, standing = ("camera", "board") if flange else ("board", "camera")
        place = own.get("place")
        near = f" near {place_text(PlacedFile.model_validate(place).position_mm)} of the base frame" if place else ""
        sits = f" near {place_text(tool.map_mm)} of the flange" if tool else ""
        return SessionGuide(
            "the corners of the board (corner, u_px, v_px; edbb import --images finds them)",
            (
                CellStep("Measure the board", "All lengths come from it: measure it over as many squares as you can."),
                CellStep(f"Fix the {standing}", f"It stands{near}; nothing moves it until the last image."),
                CellStep(f"Fix the {moving} on the flange", f"It sits{sits}, tight: its screws are the calibration."),
            ),
            (CellStep("Fix the picture", "Where the program pauses: fix focus, exposure and gain."),),
            "At each stop one image is taken once the arm is still. Name the images by the pose's number.",
        )

    @property
    def ends(self) -> tuple[str, str]:
        """Board and camera: the one stands, the other sits on the flange."""
        return ("board", "camera") if self.on_flange else ("camera", "board")

    def describe(self, cell: Site) -> str:
        """Say which camera sees which board."""
        on, off = ("camera on the flange", "standing") if self.on_flange else ("camera standing", "on the flange")
        return f"{on}, {self.board} {off}"


def _in_cone(u: Array, half: Array | float) -> Array:
    """Return directions (n, 3) that are uniform within cones of the half angles (n,) [rad] about z, for u (n, 2)."""
    z = 1 - u[:, 0] * (1 - np.cos(half))
    r, turn = np.sqrt(np.maximum(1 - z * z, 0.0)), 2 * np.pi * u[:, 1]
    return np.column_stack([r * np.cos(turn), r * np.sin(turn), z])


def frames_along(z: Array) -> Array:
    """Return frames (n, 3, 3) whose z axes are the unit vectors z (n, 3)."""
    least = np.eye(3)[np.argmin(np.abs(z), axis=1)]
    x = np.cross(least, z)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)
