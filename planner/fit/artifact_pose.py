"""Pose of the gauge's frame: as the cell declares it, and as fitted."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from planner.cell.cell import Cell, MeasurementSetup
from planner.cell.placement import N_BASE_TRANSFORMS
from planner.cell.places import placed_frame
from planner.common.units import DEG, MM, Array
from planner.fit.assumptions import FRAME_SIGMAS, NEAR_DECLARED, NEAR_DECLARED_TURN
from planner.fit.least_squares import Fit
from planner.gauges.placement.solver import LOCATED_TURN_SIGMA
from planner.model.gauge_frames import FixturePosition, GaugeFrames, PlacePose, ToolPointPosition, Vector
from planner.model.identification_document import Estimate


def use_declared_pose(cell: Cell, setup: MeasurementSetup) -> MeasurementSetup:
    """Return the set-up with the artifact's or tracker's frame as the cell declares it, if it was found near there."""
    declared = _declared_frame(cell, setup)
    if declared is None or not _is_near(cell, *_distance(*declared, setup)):
        return setup
    R, p = declared
    return replace(setup, R_BG=R[None], p_BG=p[None], turn_prior=min(setup.turn_prior, LOCATED_TURN_SIGMA))


def declared_pose_warnings(cell: Cell, setup: MeasurementSetup) -> list[str]:
    """Return a warning if the balls were found far from the pose that the cell declares."""
    declared = _declared_frame(cell, setup)
    if declared is None or not cell.gauge.at_balls:
        return []
    off, turn = _distance(*declared, setup)
    if _is_near(cell, off, turn):
        return []
    return [
        f"the run puts the balls {off / MM:.1f} mm and {turn / DEG:.2f} deg from where [artifact] of {cell.path.name} "
        "has them: was it moved, and are the units of the run right?"
    ]


def _declared_frame(cell: Cell, setup: MeasurementSetup) -> tuple[Array, Array] | None:
    """Return R (3, 3) and p (3,) [m] of the frame that the cell declares; ``None`` unless there is exactly one."""
    placed = cell.gauge.declared_frame(cell.file)
    return None if placed is None or len(setup.p_BG) > 1 else placed_frame(placed)


def _is_near(cell: Cell, off: float, turn: float) -> bool:
    robot = cell.robot
    usual = FRAME_SIGMAS * robot.usual_error(cell.home, cell.tool.p_FM)
    return off <= max(NEAR_DECLARED, usual) and turn <= max(NEAR_DECLARED_TURN, FRAME_SIGMAS * robot.usual_turn)


def _distance(R: Array, p: Array, setup: MeasurementSetup) -> tuple[float, float]:
    turn = Rotation.from_matrix(R.T @ setup.R_BG[0]).magnitude()
    return float(np.linalg.norm(setup.p_BG[0] - p)), float(turn)


def gauge_frames(fit: Fit, estimates: Iterable[Estimate], beside_robot: Mapping[str, float | None]) -> GaugeFrames:
    """Compose the poses before the fit with the fitted corrections.

    Standard deviations are those of ``estimates``, and by name those ``beside_robot``, which counts as known.
    """
    setup, error, std = fit.setup, fit.values, {e.name: e.std for e in estimates}
    framed, places = setup.has_own_frames, range(len(setup.place_names))
    return GaugeFrames(
        fixtures=tuple(
            FixturePosition(
                name=n,
                position=_as_vector(setup.p_BX[s] + _shift(error, "fixture", n)),
                position_std=_std(std, "fixture", n),
            )
            for s, n in enumerate(setup.place_names[: len(setup.p_BX)])  # a gauge of its own may have no fixture
            if not framed
        ),
        places=tuple(_place(setup, s, error) for s in places) if framed else (),
        tool=tuple(
            ToolPointPosition(
                name=n,
                p_FM=_as_vector(setup.p_FM[t] + _shift(error, "map", n)),
                position_std=_std(std, "map", n),
                std_beside_robot=_std(beside_robot, "map", n),
            )
            for t, n in enumerate(setup.point_names)
        ),
        zero=setup.zero + error.get("zero", 0.0) if setup.gauge.has_zero else None,
        zero_std=std.get("zero") if setup.gauge.has_zero else None,
    )


def _place(setup: MeasurementSetup, s: int, error: dict[str, float]) -> PlacePose:
    """Return the gauge's frame in the corrected base, C⁻¹ · T_BG: the correction C acts before the robot."""
    name = setup.place_names[s]
    R_C, p_C = np.eye(3), _shift(error, "base", name)
    for t in setup.chain.transforms[3:N_BASE_TRANSFORMS]:
        angle = error.get(f"{_label('base', name)}_r{'xyz'[t.axis]}", 0.0)
        R_C = R_C @ Rotation.from_rotvec(angle * np.eye(3)[t.axis]).as_matrix()
    rpy = Rotation.from_matrix(R_C.T @ setup.R_BG[s]).as_euler("xyz")
    return PlacePose(name=name, position=_as_vector(R_C.T @ (setup.p_BG[s] - p_C)), rpy=_as_vector(rpy))


def _label(what: str, name: str) -> str:
    return f"{what}_{name}" if name else what


def _shift(error: dict[str, float], what: str, name: str) -> Array:
    return np.array([error.get(f"{_label(what, name)}_{axis}", 0.0) for axis in "xyz"])


def _std(std: Mapping[str, float | None], what: str, name: str) -> Vector | None:
    """Standard deviations of a position's coordinates [m]; ``None`` where one of them is not known."""
    known = [v for axis in "xyz" if (v := std.get(f"{_label(what, name)}_{axis}")) is not None]
    return _as_vector(np.array(known)) if len(known) == len("xyz") else None


def _as_vector(values: Array) -> Vector:
    x, y, z = (float(v) for v in values)
    return x, y, z
