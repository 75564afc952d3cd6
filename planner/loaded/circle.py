"""The circle that a run was driven on: found from the nominal robot's measured points, whatever else was logged."""

import numpy as np

from planner.errors import InputError
from planner.loaded.types import Circle
from planner.rig import Rig
from planner.run import Run
from planner.units import MM, Array, frozen

NEAR = 0.05  # of the radius: as far off the circle a sample may lie to count as on it
ROUNDS = 8
ENOUGH = 0.5  # part of a place's samples that lie on the circle, else there is none


def points(rig: Rig, q: Array) -> Array:
    """Measured point of the nominal rig, (n, 3) [m]."""
    tool = rig.p_FM[0]
    return rig.robot.chain.carry(rig.robot.theta(q), np.asarray(tool))


def find_circle(rig: Rig, run: Run, place: int, x: Array) -> Circle:
    """Fit plane, centre and radius to the points x (n, 3) [m] of one place; strays such as ways there are left out.

    Angle 0 lies along the base's x axis (y where the circle stands across x), and the normal points up, or along +x.

    Raises:
        InputError: the points do not lie on a circle.
    """
    on = np.ones(len(x), dtype=bool)
    centre, normal, radius = _fit(x)
    for _ in range(ROUNDS):
        size = _off(x, centre, normal, radius)
        on = size <= max(float(np.quantile(size, ENOUGH)), 1e-4 * radius) * 3.0
        centre, normal, radius = _fit(x[on])
    off = _off(x, centre, normal, radius)
    if radius > 10.0 or float(np.mean(off < NEAR * radius)) < ENOUGH:
        raise InputError(
            f"{run.name}: the arm does not run on a circle at fixture '{rig.place_names[place]}': half of the samples "
            f"lie {float(np.median(off)) / MM:.1f} mm or more off the best one (radius {radius / MM:.1f} mm); only "
            "circles can be evaluated here"
        )
    return Circle(
        rig.place_names[place], place, frozen(centre), frozen(_axes(normal)), float(radius), frozen(rig.p_BX[place])
    )


def polar(circle: Circle, x: Array) -> tuple[Array, Array]:
    """Angle (n,) [rad] of points x (n, 3) [m], and how far they lie off the circle, (n,) [m]."""
    local = (x - circle.centre) @ circle.axes.T
    return np.arctan2(local[:, 1], local[:, 0]), _off(x, circle.centre, circle.axes[2], circle.radius)


def _fit(x: Array) -> tuple[Array, Array, float]:
    """Centre (3,), normal (3,) and radius of the circle through points, by plane (SVD) and algebraic circle."""
    middle = x.mean(axis=0)
    _, _, axes = np.linalg.svd(x - middle, full_matrices=False)
    local = (x - middle) @ axes[:2].T
    A = np.column_stack([2 * local, np.ones(len(x))])
    a, b, c = np.linalg.lstsq(A, (local**2).sum(axis=1))[0]
    return middle + a * axes[0] + b * axes[1], axes[2], float(np.sqrt(max(c + a * a + b * b, 1e-12)))


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
