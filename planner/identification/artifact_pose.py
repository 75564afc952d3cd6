"""Pose of the gauge's frame: as the cell declares it, and as fitted."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from planner.cell.cell import Cell
from planner.cell.places import placed_frame
from planner.cell.setup import N_BASE_TRANSFORMS, MeasurementSetup
from planner.common.units import DEG, MM, Array
from planner.identification.calibration import Calibration

# from the cell's place, as a robot by its data sheet finds it; beyond them, moved
NEAR_DECLARED, NEAR_DECLARED_TURN = 20 * MM, 6 * DEG


def use_declared_pose(cell: Cell, setup: MeasurementSetup) -> MeasurementSetup:
    """Return the setup with the one frame of an artifact or tracker where the cell has it, if found near there."""
    declared = _declared(cell, setup)
    if declared is None or not _near(*_apart(*declared, setup)):
        return setup
    R, p = declared
    return replace(setup, R_BG=R[None], p_BG=p[None])


def declared_pose_warnings(cell: Cell, setup: MeasurementSetup) -> list[str]:
    """Return what is to be told where the balls stand elsewhere than the cell says."""
    declared = _declared(cell, setup)
    if declared is None or not cell.gauge.is_surveyed:
        return []
    off, turn = _apart(*declared, setup)
    if _near(off, turn):
        return []
    return [
        f"the run puts the balls {off / MM:.1f} mm and {turn / DEG:.2f} deg from where [artifact] of {cell.path.name} "
        "has them: was it moved, and are the units of the run right?"
    ]


def _declared(cell: Cell, setup: MeasurementSetup) -> tuple[Array, Array] | None:
    """R (3, 3) and p (3,) [m] of the frame that the cell gives; ``None`` where there is not the one."""
    placed = cell.gauge.declared_frame(cell.file)
    return None if placed is None or len(setup.p_BG) > 1 else placed_frame(placed)


def _near(off: float, turn: float) -> bool:
    return off <= NEAR_DECLARED and turn <= NEAR_DECLARED_TURN


def _apart(R: Array, p: Array, setup: MeasurementSetup) -> tuple[float, float]:
    turn = Rotation.from_matrix(R.T @ setup.R_BG[0]).magnitude()
    return float(np.linalg.norm(setup.p_BG[0] - p)), float(turn)


@dataclass(frozen=True)
class GaugeFrames:
    """The gauge after the fit.

    Attributes:
        fixtures: (name, p_BX (3,) [m]) of a length gauge.
        places: (name, p_BG (3,) [m], roll, pitch, yaw (3,) [rad] about the base's fixed axes) of trackers and plates.
        points: (name, p_FM (3,) [m]) of the targets on the tool.
        zero: what the bar reads beyond its length [m]; only a length gauge has it.
    """

    fixtures: tuple[tuple[str, Array], ...]
    places: tuple[tuple[str, Array, Array], ...]
    points: tuple[tuple[str, Array], ...]
    zero: float | None


def gauge_frames(calibration: Calibration) -> GaugeFrames:
    """Compose what was known or placed before the fit with the corrections that the fit found."""
    setup = calibration.fit.model.setup
    error = dict(zip(calibration.fit.model.names, map(float, calibration.fit.errors), strict=True))
    framed = setup.gauge.frees_base
    points = tuple(
        (name, setup.p_FM[t] + _shift(error, _label("map", name), "xyz")) for t, name in enumerate(setup.point_names)
    )
    return GaugeFrames(
        fixtures=tuple(
            (name, setup.p_BX[s] + _shift(error, _label("fixture", name), "xyz"))
            for s, name in enumerate(setup.place_names)
            if not framed
        ),
        places=() if not framed else tuple(_place(setup, s, error) for s in range(len(setup.place_names))),
        points=points,
        zero=setup.zero + error.get("zero", 0.0) if setup.gauge.has_zero else None,
    )


def _place(setup: MeasurementSetup, s: int, error: dict[str, float]) -> tuple[str, Array, Array]:
    """The base's corrections stand before the robot, so the gauge's frame is what they leave of it: C⁻¹ · T_BG."""
    name = setup.place_names[s]
    label = _label("base", name)
    chain = setup.chain
    R_C, p_C = np.eye(3), _shift(error, label, "xyz")
    for t in chain.transforms[3:N_BASE_TRANSFORMS]:
        angle = error.get(f"{label}_r{'xyz'[t.axis]}", 0.0)
        R_C = R_C @ Rotation.from_rotvec(angle * np.eye(3)[t.axis]).as_matrix()
    R_BG = R_C.T @ setup.R_BG[s]
    return name, R_C.T @ (setup.p_BG[s] - p_C), np.asarray(Rotation.from_matrix(R_BG).as_euler("xyz"))


def _label(what: str, name: str) -> str:
    return f"{what}_{name}" if name else what


def _shift(error: dict[str, float], label: str, axes: str) -> Array:
    return np.array([error.get(f"{label}_{axis}", 0.0) for axis in axes])
