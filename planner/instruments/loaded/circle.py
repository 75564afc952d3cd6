"""The circle that was driven, and the sine that a centre beside the bar's fixed ball leaves (EDBB paper, eq. 9)."""

import numpy as np

from planner.cell.circles import NEAR_CIRCLE
from planner.cell.setup import MeasurementSetup
from planner.common.errors import InputError
from planner.common.units import MM, Array, read_only
from planner.instruments.loaded.types import CentringOffset, DrivenCircle
from planner.kinematics.geometry import fit_circle_in_space
from planner.runs.run import Run

CIRCLE_ROUNDS = 8
SHARE_ON_CIRCLE = 0.5  # part of a place's samples that lie on the circle, else there is none


def measured_points(setup: MeasurementSetup, q: Array) -> Array:
    """Measured point of the nominal setup, (n, 3) [m]."""
    tool = setup.p_FM[0]
    return setup.robot.chain.carry(setup.robot.theta(q), np.asarray(tool))


def find_circle(setup: MeasurementSetup, run: Run, place: int, x: Array) -> DrivenCircle:
    """Fit plane, centre and radius to the points x (n, 3) [m] of one place; strays such as ways there are left out.

    Angle 0 lies along the base's x axis (y where the circle stands across x), and the normal points up, or along +x.

    Raises:
        InputError: the points do not lie on a circle.
    """
    on = np.ones(len(x), dtype=bool)
    centre, axes, radius = fit_circle_in_space(x)
    for _ in range(CIRCLE_ROUNDS):
        size = _off(x, centre, axes[2], radius)
        on = size <= max(float(np.quantile(size, SHARE_ON_CIRCLE)), 1e-4 * radius) * 3.0
        centre, axes, radius = fit_circle_in_space(x[on])
    off = _off(x, centre, axes[2], radius)
    if radius > 10.0 or float(np.mean(off < NEAR_CIRCLE * radius)) < SHARE_ON_CIRCLE:
        raise InputError(
            f"{run.name}: the arm does not run on a circle at fixture '{setup.place_names[place]}': half of the "
            f"samples lie {float(np.median(off)) / MM:.1f} mm or more off the best one (radius {radius / MM:.1f} mm); "
            "only circles can be evaluated here"
        )
    return DrivenCircle(
        read_only(centre),
        read_only(_axes(axes[2])),
        float(radius),
        read_only(setup.p_BX[place]),
        setup.place_names[place],
        place,
    )


def _off(x: Array, centre: Array, normal: Array, radius: float) -> Array:
    """Distance of points from the circle, (n,) [m]."""
    r = x - centre
    height = r @ normal
    return np.asarray(np.hypot(np.linalg.norm(r - height[:, None] * normal, axis=1) - radius, height))


def _axes(normal: Array) -> Array:
    """Right-handed axes with the normal last, its largest part positive."""
    normal = normal * np.sign(normal[int(np.argmax(np.round(np.abs(normal), 6)))])
    helper = np.eye(3)[1 if abs(normal[0]) > 0.7 else 0]
    first = helper - normal * (helper @ normal)
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first), normal])


def centring_offset(theta: Array, y: Array) -> CentringOffset:
    """Fit a sin(θ − φ) to y (B,) [m] over whole turns θ (B,) [rad]: linear, so that there is nothing to guess.

    A centre that is off its ball shows once a turn and no otherwise, so that b of eq. 9 is 1.
    """
    A = np.column_stack([np.sin(theta), np.cos(theta)])
    (along, across), *_ = np.linalg.lstsq(A, y)
    rms = float(np.sqrt(np.mean((y - A @ np.array([along, across])) ** 2)))
    return CentringOffset(float(np.hypot(along, across)), float(np.arctan2(-across, along)), rms)


def sine(offset: CentringOffset, theta: Array) -> Array:
    """Value of the fitted sine, like ``theta`` [m]."""
    return np.asarray(offset.amplitude * np.sin(theta - offset.phase))
