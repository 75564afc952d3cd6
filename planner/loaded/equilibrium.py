"""The arm on a loaded circle: where it comes to stand when its joints yield, and which circle it has driven."""

from dataclasses import replace

import numpy as np

from planner.cell.setup import MeasurementSetup
from planner.circular.circle import NEAR_CIRCLE
from planner.common.errors import InputError
from planner.common.units import MM, Array, read_only
from planner.effects.context import Context
from planner.kinematics.geometry import fit_circle_in_space
from planner.loaded.assumptions import SAMPLES
from planner.loaded.types import AveragedCurves, CentringOffset, DrivenCircle
from planner.runs.run import Run, Samples
from planner.simulation.equilibrium import BALANCE_ROUNDS


def deflect_joints(setup: MeasurementSetup, samples: Samples, value: Array) -> Samples:
    """Return the samples with the angles to which the joints yield under weight, payload and the bar's pull.

    The torques are those at the place where the arm comes to stand, not where it was sent: the bar's direction
    follows the deflection, by up to a percent, and the weights' levers a little.

    Args:
        setup: with the fixture where it is.
        samples: as driven.
        value: compliance of every joint, (N,) [rad/Nm].
    """
    back = np.linalg.inv(setup.robot.coupling_matrix)
    q = samples.q
    for _ in range(BALANCE_ROUNDS):
        torque = Context(setup, replace(samples, q=q)).load_torque
        q = samples.q + (torque * value) @ back.T
    return replace(samples, q=read_only(q))


def lower_fixture(setup: MeasurementSetup, curves: AveragedCurves, value: Array) -> MeasurementSetup:
    """Return the setup with a circle's fixture as much lower as the weights alone bend the arm.

    Where the fixture stands is known from the arm itself, which sags as much when it is driven there.
    """
    samples = samples_of(curves, loaded=False)
    sagged = deflect_joints(setup, samples, value)
    by = (measured_points(setup, sagged.q) - measured_points(setup, samples.q)).mean(axis=0)
    return _move_fixture(setup, curves.circle.place, by)


def raise_fixture(setup: MeasurementSetup, curves: AveragedCurves, height: float) -> MeasurementSetup:
    """Return the setup with the fixture of a circle higher along the circle's normal [m]."""
    return _move_fixture(setup, curves.circle.place, height * curves.circle.axes[2])


def _move_fixture(setup: MeasurementSetup, place: int, by: Array) -> MeasurementSetup:
    p_BX = np.array(setup.p_BX)
    p_BX[place] += by
    return replace(setup, p_BX=read_only(p_BX))


def samples_of(curves: AveragedCurves, loaded: bool = True) -> Samples:
    """Every angle, load and sense of a circle as a sample, with the bar's pull or without."""
    n = curves.length.size
    force = curves.force.ravel() if loaded else np.zeros(n)
    return Samples(q=read_only(curves.q.reshape(n, -1)), place=np.full(n, curves.circle.place), force=read_only(force))


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
    centre, axes, radius = fit_circle_in_space(x)
    for _ in range(8):  # rounds of taking the samples near the circle
        size = _distance_off(x, centre, axes[2], radius)
        on = size <= max(float(np.quantile(size, SAMPLES.on_circle_share)), 1e-4 * radius) * 3.0
        centre, axes, radius = fit_circle_in_space(x[on])
    off = _distance_off(x, centre, axes[2], radius)
    if radius > 10.0 or float(np.mean(off < NEAR_CIRCLE * radius)) < SAMPLES.on_circle_share:
        raise InputError(
            f"{run.name}: the arm does not run on a circle at fixture '{setup.place_names[place]}': half of the "
            f"samples lie {float(np.median(off)) / MM:.1f} mm or more off the best one (radius {radius / MM:.1f} mm); "
            "only circles can be evaluated here"
        )
    p_BX, name = read_only(setup.p_BX[place]), setup.place_names[place]
    return DrivenCircle(read_only(centre), read_only(_axes(axes[2])), float(radius), p_BX, name, place)


def _distance_off(x: Array, centre: Array, normal: Array, radius: float) -> Array:
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
