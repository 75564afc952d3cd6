"""What is refused before a loaded circle is evaluated, and what is said of the result."""

from collections.abc import Sequence

import numpy as np

from planner.cell.cell import Cell
from planner.cell.setup import MeasurementSetup, check_load
from planner.common.errors import InputError
from planner.common.units import MM, UM
from planner.instruments.loaded.circle import measured_points
from planner.instruments.loaded.types import AveragedCurves, EvaluatedCircle, JointCompliances
from planner.kinematics.bar_geometry import bar_state

ROOM = 10.0 * MM  # beyond the bar's range that cell and program may be wrong by
SURE = 3.0  # standard deviations beyond which a negative compliance is no chance
CURVED = 10.0 * UM  # second harmonic of an offset centre, beyond which the sine is not the whole truth
BEYOND = 1.1  # times the largest load that the cell states
LINEAR = 3  # loads that it takes to see whether the arm yields in proportion
AGREE = 1.5  # times the scatter of the repeats: beyond that the loads' curves do not agree


def check_cell(cell: Cell) -> None:
    """Refuse a cell that does not say where the bar stands.

    Raises:
        InputError: another gauge, no fixture, or no tool point.
    """
    if not cell.gauge.can_be_loaded:
        raise InputError(f"{cell.path}: gauge.kind = '{cell.gauge.kind}', but loaded circles need a bar, 'ldbb'")
    if not cell.fixtures or not cell.tool.known:
        lacking = "[[fixtures]] with position_mm" if not cell.fixtures else "[tool] with map_mm"
        raise InputError(
            f"{cell.path}: {lacking} is missing; the direction of the load follows from where both balls are"
        )


def check_measured_loads(cell: Cell, curves: Sequence[AveragedCurves], name: str) -> None:
    """Refuse loads beyond what the cell states or the robot may carry.

    Raises:
        InputError: with the load and what is allowed.
    """
    largest = max(float(np.abs(c.loads).max()) for c in curves)
    stated = max((load for c in cell.circles for load in c.loads), default=np.inf)
    if largest > BEYOND * stated:
        raise InputError(
            f"{name}: the bar loads the arm with {largest:.0f} N, but the circles of {cell.path} go up to {stated:g} N "
            "only; check force_N, or loads_N in [[circles]]"
        )
    check_load(cell, largest, f"{name}: the bar loads the arm with {largest:.0f} N", "check force_N, or load less")


def check_reach(cell: Cell, setup: MeasurementSetup, curves: AveragedCurves, name: str) -> None:
    """Refuse a circle that the bar cannot reach from its fixture.

    Raises:
        InputError: with the distance and the bar's range.
    """
    x = measured_points(setup, curves.q.reshape(-1, curves.q.shape[-1]))
    length = bar_state(x, curves.circle.p_BX).length
    low, high = cell.gauge.length_min, cell.gauge.length_max
    if float(length.min()) < low - ROOM or float(length.max()) > high + ROOM:
        raise InputError(
            f"{name}: the circle of radius {curves.circle.radius / MM:.1f} mm about "
            f"{np.round(curves.circle.centre / MM, 1).tolist()} mm lies {length.min() / MM:.1f} to "
            f"{length.max() / MM:.1f} mm from fixture '{curves.circle.name}', but the bar of {cell.path.name} reaches "
            f"from {low / MM:g} to {high / MM:g} mm"
        )


def check_sign(curves: AveragedCurves, name: str) -> None:
    """Refuse forces of the wrong sign: a pull shortens the bar between arm and table, never lengthens it.

    Raises:
        InputError: with how the reading follows the load.
    """
    force, length = curves.force.mean(axis=(0, 2)), curves.length.mean(axis=(0, 2))
    slope = float(np.polyfit(force, length, 1)[0])
    each = (curves.length - curves.length[:, :1])[:, 1:] / (curves.force - curves.force[:, :1])[:, 1:]
    scatter = float(each.mean(axis=2).std() / np.sqrt(each[..., 0].size)) + 1e-15
    if slope > SURE * scatter:
        way = "pull" if force[-1] > 0 else "push"
        raise InputError(
            f"{name}: the bar at fixture '{curves.circle.name}' reads {slope * 100 / UM:+.1f} µm for each 100 N more "
            f"of force_N, as if the arm yielded against its load (a negative compliance); force_N is positive where "
            f"the bar pulls the arm to the fixture: check the sign, the log calls it a {way}"
        )


def problems_of(found: JointCompliances) -> tuple[str, ...]:
    """Return the reasons not to use the compliances."""
    return tuple(
        f"{n} came out at {v * 1e6:.3f} ± {s * 1e6:.3f} µrad/Nm, negative beyond its uncertainty: no joint yields "
        "against its load; something else bends (base, tool, links), or forces or joint angles are wrong"
        for n, v, s in zip(found.names, found.value, found.std, strict=True)
        if v < -SURE * s
    )


def warnings_of(circles: Sequence[EvaluatedCircle], found: JointCompliances) -> tuple[str, ...]:
    """Return what a person should know."""
    out = []
    for c in circles:
        name, curves = c.curves.circle.name, c.curves
        if len(curves.loads) < LINEAR:
            out.append(
                f"fixture '{name}': {len(curves.loads)} loads give a stiffness, but do not show whether the arm "
                f"yields in proportion; {LINEAR} or more would"
            )
        if int(curves.repeats.min()) < 2:
            out.append(
                f"fixture '{name}': some loads were driven once only; repeats (the paper has five) show the noise"
            )
        if len(curves.directions) < 2:
            out.append(f"fixture '{name}': driven in one sense only, so backlash cannot be told from the error")
        second = float((c.centre_offset**2).sum()) / (4 * float(curves.length.mean()))
        if second > CURVED:
            out.append(
                f"fixture '{name}': the circle is {np.linalg.norm(c.centre_offset) / MM:.1f} mm off its ball, so "
                f"{second / UM:.0f} µm of the kinematic error twice a turn are its geometry; centre it better"
            )
    if found.misfit > AGREE:
        out.append(
            f"the loads' curves differ {found.misfit:.1f} times as much as the repeats do: play, friction, links that "
            "bend as well, or a load that is not what was logged; the uncertainties allow for it"
        )
    return tuple(out)
