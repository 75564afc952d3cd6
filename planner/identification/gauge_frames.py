"""Where the gauge stands and where the targets sit, as fitted: seen from the base of the calibrated robot."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from planner.identification.types import Calibration
from planner.rig import HEAD, Rig
from planner.units import Array


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
    rig = calibration.fit.model.rig
    error = dict(zip(calibration.fit.model.names, map(float, calibration.fit.errors), strict=True))
    bar = rig.kind == "length"
    points = tuple(
        (name, rig.p_FM[t] + _shift(error, _label("map", name), "xyz")) for t, name in enumerate(rig.point_names)
    )
    return GaugeFrames(
        fixtures=tuple(
            (name, rig.p_BX[s] + _shift(error, _label("fixture", name), "xyz"))
            for s, name in enumerate(rig.place_names)
            if bar
        ),
        places=() if bar else tuple(_place(rig, s, error) for s in range(len(rig.place_names))),
        points=points,
        zero=rig.zero + error.get("zero", 0.0) if bar else None,
    )


def _place(rig: Rig, s: int, error: dict[str, float]) -> tuple[str, Array, Array]:
    """The base's corrections stand before the robot, so the gauge's frame is what they leave of it: C⁻¹ · T_BG."""
    name = rig.place_names[s]
    label = _label("base", name)
    chain = rig.chain
    R_C, p_C = np.eye(3), _shift(error, label, "xyz")
    for t in chain.transforms[3:HEAD]:
        angle = error.get(f"{label}_r{'xyz'[t.axis]}", 0.0)
        R_C = R_C @ Rotation.from_rotvec(angle * np.eye(3)[t.axis]).as_matrix()
    R_BG = R_C.T @ rig.R_BG[s]
    return name, R_C.T @ (rig.p_BG[s] - p_C), np.asarray(Rotation.from_matrix(R_BG).as_euler("xyz"))


def _label(what: str, name: str) -> str:
    return f"{what}_{name}" if name else what


def _shift(error: dict[str, float], label: str, axes: str) -> Array:
    return np.array([error.get(f"{label}_{axis}", 0.0) for axis in axes])
