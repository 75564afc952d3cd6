"""Points and tool orientations along a circle, and whether the bar reaches round it."""

import numpy as np
from scipy.spatial.transform import Rotation

from planner.cell import Cell, Circle
from planner.errors import InputError
from planner.gauge import bar_state
from planner.units import MM, Array, to_deg, to_mm
from planner.workspace import ROOM

SAGITTA = 1e-6  # [m] between the circle and the straight line from point to point
PATIENCE = 0.03  # [s] from point to point at least: controllers plan no quicker
COARSEST = np.deg2rad(2.0)  # [rad] between points at most
MARCH = np.deg2rad(5.0)  # [rad] between the places that decide which way round is taken


def span(circle: Circle) -> tuple[float, float]:
    """First and last angle that is driven, overshoot included [rad]."""
    return circle.start - circle.overshoot, circle.start + circle.sweep + circle.overshoot


def coarse_angles(circle: Circle) -> Array:
    """Angles (k,) [rad] over all that is driven, a few degrees apart."""
    first, last = span(circle)
    return np.linspace(first, last, 1 + int(np.ceil((last - first) / MARCH - 1e-9)))


def fine_angles(circle: Circle) -> Array:
    """Angles (m,) [rad] of the points that are driven; both ends of the sweep are among them."""
    step = max(np.sqrt(8.0 * SAGITTA / circle.radius), PATIENCE * circle.speed / circle.radius)
    step = min(step, COARSEST)
    edges = [*span(circle), circle.start, circle.start + circle.sweep]
    low, first, end, high = edges[0], edges[2], edges[3], edges[1]
    parts = [_even(a, b, step) for a, b in ((low, first), (first, end), (end, high)) if b > a]
    return np.append(np.concatenate([p[:-1] for p in parts]), high)


def orientations(circle: Circle, angle: Array, R_BF: Array) -> Array:
    """Tool orientations (n, 3, 3) at angles (n,) [rad], that is R_BF (3, 3) at the first angle driven.

    It is kept, or turned about the circle's normal with the bar.
    """
    turn = (angle - span(circle)[0]) * circle.follows
    return np.asarray(Rotation.from_rotvec(turn[:, None] * circle.normal).as_matrix() @ R_BF)


def check_bar(cell: Cell, circle: Circle) -> None:
    """Refuse a circle on which the bar would have to be shorter or longer than it can be.

    Raises:
        InputError: naming the angle, the length wanted there and the bar's range.
    """
    angle = fine_angles(circle)
    length = bar_state(circle.points(angle), cell.fixtures[circle.fixture].p_BX).length
    low, high = cell.gauge.length_min + ROOM, cell.gauge.length_max - ROOM
    worst = int(np.argmax(np.maximum(low - length, length - high)))
    if low <= length[worst] <= high:
        return
    name = cell.fixtures[circle.fixture].name
    raise InputError(
        f"{cell.path}: circle {circle.name} (radius {circle.radius / MM:g} mm) about fixture {name} needs a bar of "
        f"{to_mm(length[worst]):.1f} mm at {to_deg(angle[worst]):.0f}°, it goes from {to_mm(low):g} to "
        f"{to_mm(high):g} mm ({to_mm(ROOM):g} mm kept from either end): change radius_mm or centre_mm, or take "
        "another bar"
    )


def _even(low: float, high: float, step: float) -> Array:
    return np.linspace(low, high, 1 + int(np.ceil((high - low) / step - 1e-9)))
